"""Random check values and derived numbers among the fields of a message or record."""

from __future__ import annotations

import random
from collections.abc import Callable, Collection, Sequence
from typing import Any

from tests.support.whole.reference import checks

Field = tuple[str, Any]
_CRCS = (
    "crc-8/nrsc-5", "crc-8/smbus", "crc-8/maxim-dow", "crc-16/modbus", "crc-16/xmodem", "crc-16/dnp",
    "crc-16/kermit", "crc-24/openpgp", "crc-32/iso-hdlc", "crc-32/mpeg-2", "crc-64/xz",
)  # fmt: skip


def add_filled(
    rng: random.Random,
    made: list[Field],
    name: Callable[[], str],
    *,
    room: int,
    varied: Collection[str] = (),
) -> None:
    """Insert check values and derived numbers of at most `room` bytes where the fields before have places."""
    for _ in range(rng.choice((1, 1, 2))):
        whole = [place for place in range(len(made)) if _has_place(made[place][1], varied)]
        walked = len(whole) < len(made)
        end = next((at for at, (_, spec) in enumerate(made) if _optional(spec)), len(made))
        place = rng.randint(1, end) if end else 0
        first = place
        while first and (first - 1 in whole if walked else not _dated(made[first - 1][1])):
            if _varies(made[first - 1][1], varied) and walked:
                break
            first -= 1
        if first == place:
            continue
        start = rng.randint(first, place - 1)
        spec, size = _filled(rng, made, start, place)
        if size <= room:
            added = name()
            made.insert(place, (added, spec))
            _cover(made, place, added)
            room -= size


def _filled(rng: random.Random, made: Sequence[Field], start: int, place: int) -> tuple[Any, int]:
    """A number that follows from fields from `start` on, before `place`."""
    plain = [(each, spec) for each, spec in made[start:place] if _is_plain(spec)]
    order: dict[str, str] = {"byteorder": rng.choice(("big", "little"))} if rng.random() < 0.3 else {}
    if plain and rng.random() < 0.4:
        source, kind = rng.choice(plain)
        kind = kind["type"] if isinstance(kind, dict) else kind
        text = rng.choice(("{}", "~{}", "~ {}", "{} + 1", "{} - 300", "~{} + 7")).format(source)
        return {"type": kind, **order, "equals": text}, int(kind[1:]) // 8
    end = rng.randint(start + 1, place)
    algorithm = rng.choice((*_CRCS, *checks.sums(8), *checks.sums(16), *checks.sums(32)))
    bits = checks.width(algorithm)
    over = [each for each, _ in made[start:end]]
    init = {"init": rng.choice((0, 1, (1 << bits) - 1))} if rng.random() < 0.2 else {}
    return {"type": f"u{bits}", **order, "algorithm": algorithm, **init, "over": over}, bits // 8


def _cover(made: Sequence[Field], place: int, added: str) -> None:
    """Let check values over fields around a new one cover it too."""
    names = [each for each, _ in made]
    for _, spec in made[place + 1 :]:
        over = spec.get("over") if isinstance(spec, dict) else None
        if over and names.index(over[0]) < place < names.index(over[-1]):
            over[:] = names[names.index(over[0]) : names.index(over[-1]) + 1]


def _is_plain(spec: Any) -> bool:
    """Whether other numbers can be derived from it."""
    keys = set(spec) if isinstance(spec, dict) else set()
    kind = str(spec["type"] if isinstance(spec, dict) else spec) if not keys or "type" in keys else ""
    whole = kind[:1] == "u" and kind[1:].isdecimal() and int(kind[1:]) <= 64 and int(kind[1:]) % 8 == 0
    return whole and not keys & {"as", "groups", "parts"}


def _dated(spec: Any) -> bool:
    """Whether some versions do not have it."""
    return isinstance(spec, dict) and bool({"since", "until", "switch"} & spec.keys())


def _optional(spec: Any) -> bool:
    return isinstance(spec, dict) and "optional" in spec


def _varies(spec: Any, varied: Collection[str]) -> bool:
    """Whether its size is not constant."""
    kind = str(spec.get("type", "") if isinstance(spec, dict) else spec)
    base, bracket, count = kind.partition("[")
    count = count.rstrip("]")
    return base in varied or kind in ("bytes", "text", "") or (bool(bracket) and not count.isdecimal())


def _has_place(spec: Any, varied: Collection[str]) -> bool:
    """Whether what follows it has a place that depends on counts alone."""
    keys = set(spec) if isinstance(spec, dict) else set()
    kind = str(spec.get("type", "") if isinstance(spec, dict) else spec)
    changing = {"if", "optional", "terminator", "switch", "last"} & keys
    return not changing and not _dated(spec) and kind.partition("[")[0] not in varied
