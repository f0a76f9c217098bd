"""Random terminators, with codings that keep them from occurring before."""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import Any

Doc = dict[str, Any]


@dataclass(frozen=True)
class Ending:
    """A terminator and the codings of what precedes it; without any, payloads use seven bits a byte."""

    terminator: str
    codings: list[Doc]

    @property
    def coding(self) -> object:
        """The value of the key."""
        return self.codings[0] if len(self.codings) == 1 else self.codings


def openly(rng: random.Random, frame: Doc) -> None:
    """Let a frame with a length or counts travel in a coding that is decoded as it is read."""
    names = list(frame["parts"])
    if any({"trim", "every"} & spec.keys() for spec in frame["parts"].values()):
        return
    start = frame["parts"][names[0]]
    lead = int(start.get("role", "value" in start and "constant") == "constant")
    kinds: list[Doc] = [
        *(_escaped(rng).codings[0], _replaced(rng).codings[0]),
        *({"digits": "hex"}, {"pair": "complement"}, {"add": _hex(rng.randrange(256))}),
    ]
    coding = rng.choice(kinds)
    specs = list(frame["parts"].values())
    counted = any("counts" in spec for spec in specs) and any("over" in spec for spec in specs)
    if counted and rng.random() < 0.3:
        coding = {"add": _hex(rng.randrange(1, 256)), "checked": "after"}
    elif rng.random() < 0.4:
        payload = next(at for at, name in enumerate(names) if frame["parts"][name].get("role") == "payload")
        first, last = rng.randint(lead, payload), rng.randint(payload, len(names) - 1)
        coding = {**coding, "over": names[first : last + 1]}
    elif not lead and rng.random() < 0.5:
        coding = {**coding, "over": names}
    frame["coding"] = coding


def as_coding(frame: Doc) -> None:
    """Write a stuffing as a coding."""
    stuffing = frame.pop("stuffing")
    frame["coding"] = {"insert": stuffing["insert"], "after": stuffing["after"]}
    if stuffing.get("checksum") == "after":
        frame["coding"]["checked"] = "after"
        return
    names = [name for name, spec in frame["parts"].items() if spec.get("role") != "idle"]
    frame["coding"]["over"] = [name for name in names if name not in stuffing.get("exempt", ())]


def silence(rng: random.Random, parts: Doc) -> None:
    """Let only an idle line end the frame: without terminator and length."""
    gone = [name for name, spec in parts.items() if spec.get("role") in ("terminator", "length")]
    for name in gone:
        del parts[name]
    payload = next(name for name, spec in parts.items() if spec.get("role") == "payload")
    for spec in parts.values():
        if "over" in spec:
            spec["over"] = [each for each in spec["over"] if each not in gone] or [payload]
    time = rng.choice(("3.5 bytes", "20 ms", "4 bytes"))
    least = {"at_least": rng.choice(("1750 us", "1 ms"))} if rng.random() < 0.5 else {}
    parts["silence"] = {"role": "idle", "time": time, "alone": True, **least}


def choose(rng: random.Random) -> Ending:
    """An ending of any kind."""
    kinds = ("bare", "escape", "replace", "cobs", "digits", "pair", "list")
    kind = rng.choices(kinds, (14, 22, 14, 12, 12, 12, 18))[0]
    if kind == "bare":
        return Ending(rng.choice(("FF", "80", "FE 0A", "0D 8A", "A5 A5")), [])
    if kind == "cobs":
        return Ending("00", [{"cobs": "00"}])
    if kind == "digits":
        return Ending(rng.choice(("0D 0A", "0D", "00", "0A 0A", "3B", "FF")), [{"digits": "hex"}])
    if kind == "pair":
        return _doubled(rng)
    if kind == "list":
        return _several(rng)
    return _escaped(rng) if kind == "escape" else _replaced(rng)


def _several(rng: random.Random) -> Ending:
    first = rng.choice(
        (
            {"add": _hex(rng.randrange(256))},
            {"pair": "complement"},
            {"digits": "hex"},
            {"insert": _hex(rng.randrange(256)), "after": rng.choice(("A5", "A5 A5", "00 01 00", "7D"))},
        )
    )
    last = rng.choice((_escaped(rng), _replaced(rng), Ending("00", [{"cobs": "00"}])))
    if rng.random() < 0.2:
        last = Ending(
            rng.choice(("0D", "0D 0A")), [*last.codings[: "cobs" not in last.codings[0]], {"digits": "hex"}]
        )
    return Ending(last.terminator, [first, *last.codings])


def _escaped(rng: random.Random) -> Ending:
    while True:
        mask = rng.choice((0x20, 0x20, 0x01, 0x40, 0xFF, 0x5A))
        marked = rng.choice(
            ([0x7E, 0x7D], [0x7E, 0x7D], [0xC0, 0xDB, 0x11, 0x13], [0x03, 0x10], [0xA5, 0x00])
        )
        escape = rng.choice(marked[:2])
        end = rng.choice([each for each in marked if each != escape])
        if not {each ^ mask for each in marked} & {*marked}:
            spec = {"escape": _hex(escape), "xor": _hex(mask), "of": list(map(_hex, marked))}
            more = rng.choice(("", "", " 0A")) if 0x0A not in marked else ""
            return Ending(_hex(end) + more, [spec])


def _doubled(rng: random.Random) -> Ending:
    """A byte that is doubled, or followed by another, and that begins the terminator as well."""
    first, second, end = rng.choice((("10", "10", "03"), ("A5", "00", "A5"), ("DB", "DC", "03")))
    if second == "DC":
        return Ending(f"{first} {end}", [{"replace": {"DB": "DB DC", "7E": "DB 01"}}])
    return Ending(f"{first} {end}", [{"insert": second, "after": first}])


def _replaced(rng: random.Random) -> Ending:
    numbers = rng.sample(range(256), 6)
    escape, end, more, *seconds = numbers
    if rng.random() < 0.5:
        escape, end, seconds = 0xDB, 0xC0, [0xDD, 0xDC, 0xDE]
        more = 0x11
    codes = {_hex(escape): seconds[0], _hex(end): seconds[1]}
    if rng.random() < 0.3:
        codes[_hex(more)] = seconds[2]
    pairs = {key: f"{_hex(escape)} {_hex(second)}" for key, second in codes.items()}
    return Ending(_hex(end), [{"replace": dict(sorted(pairs.items(), key=lambda _: rng.random()))}])


def _hex(byte: int) -> str:
    return f"{byte:02X}"
