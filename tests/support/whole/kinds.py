"""Random protocols with several kinds of frame: their parts, and which messages share kinds."""

from __future__ import annotations

import copy
import random
import re
from dataclasses import dataclass, field
from typing import Any

from tests.support.whole import conditional
from tests.support.whole.frames import Shape, draw_algorithm, order, width_type
from tests.support.whole.mixed import draw_value

Doc = dict[str, Any]
_LEADS = ("68", "10", "02", "A5 5A", "A5 A5", "24 4D", "24 58", "FF", "7E 01", "3A")
_NAMES = ("short", "long", "ack", "command", "plain", "wide")
_SIZES = (0, 4, 8, 16, 40, 120, 200)


@dataclass
class Family:
    """Kinds that carry the same messages: one that messages name, or some that none names.

    Attributes:
        name: what messages write, "" if they write nothing.
        ids: those in use.
        ended: a terminator ends its frames, so it carries texts.
    """

    shape: Shape
    name: str
    ids: set[int] = field(default_factory=set)
    ended: bool = False

    @property
    def spec(self) -> Doc:
        """What a message writes."""
        return {"frame": self.name} if self.name else {}


@dataclass
class Kinds:
    """The kinds of frame of a protocol."""

    frames: Doc
    families: list[Family]

    @property
    def addressed(self) -> bool:
        """Whether any kind has an address."""
        return any(each.shape.address_bits for each in self.families)


def draw(rng: random.Random) -> Kinds:
    """Two or three families of kinds, or one of several kinds."""
    leads, names = rng.sample(_LEADS, len(_LEADS)), rng.sample(_NAMES, len(_NAMES))
    address = ("node", rng.choice(("u8", "u8", "u16"))) if rng.random() < 0.6 else ("", "")
    frames: Doc = {}
    families: list[Family] = []
    shared = rng.random() < 0.5
    for index in range(rng.choice((1, 2, 2, 3)) if shared else rng.choice((2, 2, 3))):
        name, lead = names.pop(), leads.pop()
        held = address if index == 0 or rng.random() < 0.7 else ("", "")
        shape = _kind(rng, lead, held, variable=shared and index == 0)
        frames[name] = {"parts": shape.frame["parts"]}
        families.append(Family(shape, name))
        if shared and index == 0:
            families[0].name = ""
            for _ in range(rng.choice((1, 1, 2))):
                frames[names.pop()] = {"parts": _longer(rng, shape, leads.pop())}
    if rng.random() < 0.4:
        lead = leads.pop()
        shape = Shape("kinds", {"parts": {"byte": lead}}, 0, 0, 0, families[0].shape.bus, has_length=False)
        frames[names.pop()] = {"parts": {"byte": lead}}
        families.append(Family(shape, next(reversed(frames))))
    for each in families:
        each.shape.bus = families[0].shape.bus
    # Drawn from another source: the schemas of earlier seeds stay what they are.
    more = random.Random(repr(rng.getstate()))
    _add_values(more, frames, families)
    if more.random() < 0.35:
        shape = _ended(more, leads.pop())
        shape.bus = families[0].shape.bus
        frames["line"] = {"parts": shape.frame["parts"]}
        families.append(Family(shape, "line", ended=True))
    coded = random.Random(f"coded {more.getstate()!r}")
    if coded.random() < 0.35:
        families.append(_coded(coded, frames, leads.pop(), families[0].shape.bus))
    _add_one_way(random.Random(repr(more.getstate())), frames, families)
    _add_codings(random.Random(f"codings {more.getstate()!r}"), frames)
    _add_conditions(random.Random(f"conditions {more.getstate()!r}"), frames, families)
    _add_blocks(random.Random(f"blocks {more.getstate()!r}"), frames)
    mixed = list(frames)
    rng.shuffle(mixed)
    return Kinds({name: frames[name] for name in mixed}, families)


def prove(rng: random.Random, frame: Doc, fields: Doc) -> None:
    """Let some responses end with a check value that covers pieces of the request, which is in a frame."""
    parts: Doc = frame.get("parts", {})
    absent = any(isinstance(spec, dict) and "if" in spec for spec in parts.values())
    known = [name for name in ("node", "code", "data") if name in parts]
    if not known or absent or "coding" in frame or rng.random() < 0.2:
        return
    algorithms = {"crc-16/xmodem": "u16", "crc-32/iso-hdlc": "u32", "xor8": "u8", "sum8-zero": "u8"}
    algorithm, kind = rng.choice(list(algorithms.items()))
    over = [f"request.{each}" for each in rng.sample(known, rng.randint(1, len(known)))]
    if any(
        isinstance(spec, dict) and spec.keys() & {"optional", "since", "until"} for spec in fields.values()
    ):
        return
    name = next(each for each in ("proof", "proof_2", "proof_3") if each not in fields)
    order = rng.choice(("big", "little"))
    fields[name] = {"type": kind, "algorithm": algorithm, "over": [*over, *fields], "byteorder": order}


def prove_by_kind(rng: random.Random, several: Kinds, response: Doc, most: int) -> bool:
    """Let a kind of its own state the check value of a response, in some schemas; return whether it does."""
    fields = response["fields"]
    last = next(reversed(fields))
    if "proven" in several.frames or not last.startswith("proof") or rng.random() < 0.5:
        return False
    check = fields.pop(last)
    check["over"] = [*(each for each in check["over"] if each.startswith("request.")), "data"]
    room = most - int(check["type"][1:]) // 8
    several.frames["proven"] = {"parts": {"data": {"role": "payload", "size": f"0..{room}"}, last: check}}
    response["frame"] = "proven"
    return True


def lead_with_addresses(rng: random.Random, several: Kinds, bus: Doc) -> None:
    """Let one kind begin with its address, if no other kind then begins like it."""
    numbers = {int(each) for each in re.split(r"\.\.", bus.get("nodes", "0..65535"))}
    starts = {*range(min(numbers), max(numbers) + 1), bus.get("broadcast", min(numbers))}
    for family in rng.sample(several.families, len(several.families)):
        frame = several.frames.get(family.name, {})
        parts = frame.get("parts", {})
        known = parts.get("node", {}) == {"role": "address", "type": "u8"} and "start" in parts
        if not known or family.ended or "coding" in frame or max(starts) > 0xFF or rng.random() < 0.3:
            continue
        begun = {first for name in several.frames if name != family.name for first in _begun(several, name)}
        if not starts.isdisjoint(begun):
            continue
        _lead(parts, "node")
        return


def lead_with_bits(rng: random.Random, several: Kinds) -> None:
    """Let one kind begin with a byte whose constant and piece of the id tell it, if no other then can."""
    firsts = [next(iter(each["parts"].values())) for each in several.frames.values()]
    if any(isinstance(each, dict) and each["role"] == "address" for each in firsts):
        return
    for family in several.families:
        frame = several.frames.get(family.name, {})
        parts = frame.get("parts", {})
        if not {"head", "start"} <= parts.keys() or "coding" in frame or family.ended or rng.random() < 0.2:
            continue
        fixed = parts["head"]["bits"]["fixed"]["const"] << 6
        starts = {fixed | spare << 5 | number for number in family.ids for spare in (0, 1)}
        if starts.isdisjoint(
            first for name in several.frames if name != family.name for first in _begun(several, name)
        ):
            _lead(parts, "head")
            return


def _lead(parts: Doc, name: str) -> None:
    """Move a part to the beginning of a frame, in place of the constant there."""
    rest = {each: spec for each, spec in parts.items() if each not in ("start", name)}
    for spec in (each for each in rest.values() if isinstance(each, dict)):
        for key in ("over", "counts"):
            if isinstance(spec.get(key), list):
                seeds = [each for each in spec[key] if each.startswith("attribute.")]
                spec[key] = [each for each in (name, *rest) if each in spec[key]] + seeds or [name]
    first = parts[name]
    parts.clear()
    parts |= {name: first, **rest}


def _begun(several: Kinds, name: str) -> set[int]:
    """What the frames of a kind may begin with."""
    frame = several.frames[name]
    first = next(iter(frame["parts"].values()))
    found = {bytes.fromhex(frame["coding"]["insert"])[0]} if "insert" in frame.get("coding", {}) else set()
    if isinstance(first, str):
        return found | {bytes.fromhex(first)[0]}
    if first["role"] == "payload":
        return found
    ids = {number for family in several.families if family.name == name for number in family.ids}
    size = int(first["type"][1:]) // 8
    both = {each for number in ids for each in (number >> 8 * (size - 1), number & 0xFF)}
    return found | both


def lead_with_ids(rng: random.Random, several: Kinds) -> None:
    """Let one kind begin with its message id, if no other kind then begins like it."""
    for family in rng.sample(several.families, len(several.families)):
        parts = several.frames[family.name]["parts"] if family.name else {}
        code = parts.get("code", {})
        ended = family.ended or family.name == "coded"
        one_way = "coding" in several.frames.get(family.name, {}) and _is_one_way(parts)
        if code.get("role") != "message" or "group" in parts or ended or one_way or rng.random() < 0.1:
            continue
        size = int(code["type"][1:]) // 8
        starts = {number.to_bytes(size, "big")[:1] for number in family.ids}
        starts |= {number.to_bytes(size, "little")[:1] for number in family.ids}
        others = [each["parts"] for name, each in several.frames.items() if name != family.name]
        codings = [each.get("coding", {}) for each in several.frames.values()]
        inserted = [bytes.fromhex(each["insert"]) for each in codings if "insert" in each]
        begun = [bytes.fromhex(next(iter(each.values())))[:1] for each in others] + inserted
        if not starts.isdisjoint(begun):
            continue
        del parts["start"]
        rest = {name: spec for name, spec in parts.items() if name != "code"}
        for spec in (each for each in rest.values() if isinstance(each, dict)):
            for key in ("over", "counts"):
                if isinstance(spec.get(key), list):
                    seeds = [name for name in spec[key] if name.startswith("attribute.")]
                    spec[key] = [name for name in ("code", *rest) if name in spec[key]] + seeds or ["code"]
        parts.clear()
        parts |= {"code": code, **rest}
        coding = several.frames[family.name].get("coding")
        if coding is not None and "checked" not in coding:
            coding["over"] = [each for each in coding.get("over", rest) if each != "code"]
        if not family.shape.most and size == 1 and not {*rest} - {"crc", "also", "second", "stop"}:
            parts.clear()
            parts |= {"code": code, "inverse": {"type": "u8", "equals": "~code"}}
            several.frames[family.name].pop("coding", None)
            family.shape.seeds = {}
        return


def _ended(rng: random.Random, lead: str) -> Shape:
    """A kind of frame with a terminator, which no text holds."""
    parts: Doc = {"start": lead, "code": {"role": "message", "type": "u8"}}
    if rng.random() < 0.4:
        parts["length"] = {"type": "u8", "counts": rng.choice((["data"], ["code", "data"]))}
    parts["data"] = {"role": "payload", "size": rng.choice(("0..40", "0..64"))}
    check: Doc = {"type": "u8", "algorithm": rng.choice(("xor8", "sum8")), "over": ["code", "data"]}
    early = rng.random() < 0.3
    if early:
        parts["crc"] = check | {"as": "hex[2]"}
    parts["close"] = {
        "role": "terminator",
        "value": rng.choice(("80", "FE 0A", "0D 8A", "80" if lead == "FF" else "FF")),
    }
    if not early and rng.random() < 0.6:
        parts["crc"] = check | rng.choice(({}, {"as": "hex[2]"}))
    if rng.random() < 0.3:
        parts["last"] = rng.choice(("0A", "0D 0A"))
    least, most = map(int, parts["data"]["size"].split(".."))
    return Shape("kinds", {"parts": parts}, least, most, 7, "", has_length=True)


def _coded(rng: random.Random, frames: Doc, lead: str, bus: str) -> Family:
    """A kind of frame with a terminator that its coding keeps from occurring before."""
    shape = _ended(rng, lead)
    shape.bus = bus
    parts = shape.frame["parts"]
    end = parts["close"]["value"].split()[-1]
    codings: list[tuple[str, Doc | list[Doc]]] = [
        (parts["close"]["value"], {"escape": "7D", "xor": "20", "of": [end, "7D"]}),
        ("C0", {"replace": {"C0": "DB DC", "DB": "DB DD"}}),
        ("00", {"cobs": "00"}),
        (parts["close"]["value"], {"digits": "hex"}),
        ("00 8A", [{"add": "21"}, {"cobs": "00"}]),
        ("DB 03", {"insert": "DB", "after": "DB"}),
        ("C0", [{"pair": "complement"}, {"replace": {"C0": "DB DC", "DB": "DB DD"}}]),
    ]
    parts["close"]["value"], coding = rng.choice(codings)
    if "digits" in coding:
        parts["close"]["value"] = "80"
    frames["coded"] = {"parts": parts, "coding": coding}
    return Family(shape, "coded")


def _add_conditions(rng: random.Random, frames: Doc, families: list[Family]) -> None:
    """Let values of the header, or a length, decide about parts of one kind of frame."""
    able = [each for each in families if each.name and not each.ended and "coding" not in frames[each.name]]
    able = [each for each in able if {"length", "data"} <= frames[each.name]["parts"].keys()]
    able = [each for each in able if not each.shape.seeds]
    if able and rng.random() < 0.5:
        parts: Doc = frames[able[0].name]["parts"]
        _name_roles(parts)
        conditional.add(rng, frames[able[0].name])
        for name, spec in parts.items():
            if spec.keys() == {"role", "value"}:
                parts[name] = spec["value"]


def _add_blocks(rng: random.Random, frames: Doc) -> None:
    """Check values for blocks of the payload of one kind of frame, or one for no payload."""
    plain = {"start", "code", "node", "length", "data", "head", "group", "second", "stop", "crc"}
    for spec in frames.values():
        parts: Doc = spec["parts"]
        check = parts.get("crc", {"over": []})
        seeded = any(name.startswith("attribute.") for name in check["over"])
        able = {"length", "data"} <= parts.keys() <= plain and not seeded and "coding" not in spec
        if not able or rng.random() < 0.5:
            continue
        if "crc" in parts and rng.random() < 0.5:
            parts["crc"] = {**check, "over": ["data"], "otherwise": rng.choice((0, 5, 255))}
            return
        every = rng.choice(("4 bytes", "16 bytes"))
        blocks = {"type": "u8", "algorithm": "sum8", "over": ["data"], "every": every}
        names = [name for name in parts if name != "crc"]
        names.insert(names.index("data") + 1, "sums")
        found = {name: blocks if name == "sums" else parts[name] for name in names}
        parts.clear()
        parts |= found
        return


def _name_roles(parts: Doc) -> None:
    """Write out the roles that keys tell, and constants as mappings."""
    for name, spec in parts.items():
        if isinstance(spec, str):
            parts[name] = {"role": "constant", "value": spec}
        elif "role" not in spec:
            told = (("counts", "length"), ("algorithm", "checksum"), ("value", "constant"))
            role = next((role for key, role in told if key in spec), "")
            parts[name] = {"role": role, **spec} if role else spec


def _add_codings(rng: random.Random, frames: Doc) -> None:
    """Codings of some kinds of frame whose end a length or the message tells."""
    for spec in frames.values():
        parts: Doc = spec["parts"]
        roles = {each.get("role") for each in parts.values() if isinstance(each, dict)}
        if "coding" in spec or "terminator" in roles or len(parts) == 1 or rng.random() < 0.65:
            continue
        first, *names = parts
        lead = bytes.fromhex(parts[first])
        codings: list[Doc] = [
            {"escape": "7D", "xor": "20", "of": ["7E", "7D"]},
            {"replace": {"C0": "DB DC", "DB": "DB DD"}},
            {"digits": "hex"},
            {"pair": "complement"},
            {"add": "21"},
        ]
        if len(lead) > 1:
            insert = rng.choice(("00", "5B"))
            codings += 3 * [{"insert": insert, "after": f"{lead[0]:02X}"}]
        if _counts_sent(parts):
            codings += [{"add": "33", "checked": "after"}]
            codings += [{"insert": "00", "after": "A5 5A", "checked": "after"}] if len(lead) < 2 else []
            codings += [{**codings[5], "checked": "after"}] if len(lead) > 1 else []
        coding = dict(rng.choice(codings))
        if "checked" not in coding and "data" in parts and not _is_one_way(parts) and rng.random() < 0.4:
            data = names.index("data")
            coding["over"] = names[rng.randint(0, data) : rng.randint(data + 1, len(names))]
        spec["coding"] = coding


def _is_one_way(parts: Doc) -> bool:
    """Whether some parts are only in the frames of one direction."""
    return any("if" in each for each in parts.values() if isinstance(each, dict))


def _counts_sent(parts: Doc) -> bool:
    """Whether the length of a frame and its check value can be about the coded payload."""
    length = parts.get("length")
    if length is None or "again" in parts or not {"data", "crc"} <= parts.keys():
        return False
    most = int(parts["data"]["size"].split("..")[1])
    return length["type"] != "u8" or 2 * most + len(parts) * 4 < 256


def _add_values(rng: random.Random, frames: Doc, families: list[Family]) -> None:
    """Values of some kinds of frame, and an attribute of messages that some check values cover."""
    known: Doc = {"status": draw_value(rng), "component": draw_value(rng)}
    counter: Doc = {"role": "counter", **rng.choice(({}, {"per": "frame"}))}
    if "per" not in counter and random.Random(f"repeats {rng.getstate()!r}").random() < 0.5:
        counter["repeats"] = "answered"
    known["sequence"] = {**counter, "type": rng.choice(("u8", "u16"))}
    if rng.random() < 0.3:
        bits = {"toggle": {**counter, "at": 5}, "grade": {"at": "0..2", "signed": True}, "ready": 7}
        known["sequence"] = {"type": "u8", "bits": bits}
    held = [name for name in known if rng.random() < 0.4]
    seeds: Doc = {"crc_extra": {"type": rng.choice(("u8", "u16", "u32"))}} if rng.random() < 0.2 else {}
    named = {each.name for each in families}
    for each in families:
        own = [frames[each.name]] if each.name else [frames[name] for name in frames if name not in named]
        if set(own[0]["parts"]) == {"byte"}:
            continue
        chosen = {name: rng.random() for name in held if rng.random() < 0.7}
        covered = rng.random() < 0.5
        for kind in own:
            for name, place in chosen.items():
                kind["parts"] = _with_value(kind["parts"], name, known[name], place, covered=covered)
        if all("crc" in kind["parts"] for kind in own):
            each.shape.seeds = seeds
            for kind in own if seeds else ():
                kind["parts"]["crc"]["over"] = [*kind["parts"]["crc"]["over"], "attribute.crc_extra"]
        each.shape.frame["parts"] = own[0]["parts"]


def _add_one_way(rng: random.Random, frames: Doc, families: list[Family]) -> None:
    """Parts that only the frames of one direction have, of some kinds."""
    names = ["origin", "outcome", "stamp", "fixed_mark", "early_sum"]
    named = {each.name for each in families}
    for each in families:
        own = [each.name] if each.name else [name for name in frames if name not in named]
        if rng.random() < 0.65 or not names or set(frames[own[0]]["parts"]) == {"byte"}:
            continue
        each.shape.directed = True
        for _ in range(min(len(names), rng.choice((1, 1, 2)))):
            name = names.pop(rng.randrange(len(names)))
            way = {"if": {"direction": rng.choice(("request", "response", "not request"))}}
            place, covered = rng.random() / 2 if each.ended else rng.random(), rng.random() < 0.7
            kept = _one_way(rng, name, ended=each.ended)
            for kind in own:
                parts = frames[kind]["parts"]
                over = {"over": [next(iter(parts))]} if "algorithm" in kept else {}
                frames[kind]["parts"] = _with_value(parts, name, kept | over | way, place, covered=covered)
        each.shape.frame["parts"] = frames[own[0]]["parts"]


def _one_way(rng: random.Random, name: str, *, ended: bool) -> Doc:
    """A constant, a check value over the first part, or a value; the same in every kind."""
    if name == "fixed_mark":
        return {"value": "01" if ended else rng.choice(("55", "01 02"))}
    if name == "early_sum" and not ended:
        return {"type": "u8", "algorithm": rng.choice(("sum8", "xor8"))}
    return {"type": "u8", "range": "0..1"} if ended or name == "origin" else {"type": "u8", "default": 3}


def turn(rng: random.Random, several: Kinds, found: Doc) -> None:
    """Let some kinds go one direction alone: those of which all messages do. They may begin alike."""
    sent = _directions(found)
    ways: dict[str, str] = {}
    for each in several.families:
        way = sent.get(each.name, set())
        alone = each.name and not each.shape.directed and len(way) == 1 and way <= {"request", "response"}
        if alone and rng.random() < 0.6:
            ways[each.name] = next(iter(way))
            several.frames[each.name]["if"] = {"direction": ways[each.name]}
    asks = [name for name, way in ways.items() if way == "request"]
    tells = [name for name, way in ways.items() if way == "response"]
    if asks and tells and rng.random() < 0.7:
        parts = several.frames[tells[0]]["parts"]
        lead = next(iter(several.frames[asks[0]]["parts"].values()))
        if isinstance(lead, str) and isinstance(parts[next(iter(parts))], str):
            parts[next(iter(parts))] = lead if rng.random() < 0.6 or "byte" in parts else f"{lead} 5A"


def _directions(found: Doc) -> dict[str, set[str]]:
    """The directions of the messages of each kind; "both" if one has none."""
    sent: list[tuple[str, str]] = []
    for spec in found["commands"].values():
        kind, response = spec.get("frame", ""), spec["response"]
        stated = response.get("frame") if isinstance(response, dict) else None
        answer = stated if isinstance(stated, str) and "fields" in response else kind
        sent += [(kind, "request"), (answer, "response")]
        for step in spec.get("steps", ()):
            sent += [
                (step[key]["frame"], way)
                for key, way in (("send", "request"), ("receive", "response"))
                if isinstance(step.get(key), dict)
            ]
    sent += [(each.get("frame", ""), each.get("direction", "both")) for each in found["messages"].values()]
    sent += [(each.get("frame", ""), "response") for each in found.get("replies", {}).values()]
    return {name: {way for other, way in sent if other == name} for name, _ in sent}


def _with_value(parts: Doc, name: str, spec: Doc, place: float, *, covered: bool) -> Doc:
    """The parts with one more: before the payload, after it, or at the end."""
    names = list(parts)
    payload = names.index("data") if "data" in parts else len(names)
    # The same order in every kind of a family.
    behind = payload + 1 if place < 0.75 else len(names)
    at = 1 + int(2 * place * payload) if place < 0.5 else behind
    names.insert(min(max(1, at), len(names)), name)
    found = {each: spec if each == name else parts[each] for each in names}
    if covered and "crc" in found:
        over = [each for each in names if each in {*found["crc"]["over"], name}]
        found["crc"] = {**found["crc"], "over": over}
    return found


def _identified(rng: random.Random, *, variable: bool) -> tuple[Doc, list[tuple[str, int]], int]:
    """Parts with the id of a message, the bits of its pieces, and all its bits."""
    header = Doc()
    id_bits = rng.choice((8, 8, 8, 16)) if variable or rng.random() < 0.85 else 0
    pieces: list[tuple[str, int]] = []
    if id_bits == 16 and rng.random() < 0.5:
        header |= {"group": {"role": "message", "type": "u8"}, "code": {"role": "message", "type": "u8"}}
        pieces = [("group", 8), ("code", 8)]
    elif id_bits == 8 and rng.random() < 0.3:
        bits = {"code": {"at": "0..4", "role": "message"}, "fixed": {"at": "6..7", "const": rng.randrange(4)}}
        header["head"], id_bits, pieces = {"type": "u8", "bits": bits}, 5, [("code", 5)]
    elif id_bits:
        header["code"] = {"role": "message", "type": f"u{id_bits}", **order(rng)}
    return header, pieces, id_bits


def _kind(rng: random.Random, lead: str, address: tuple[str, str], *, variable: bool) -> Shape:
    """A kind of frame; `variable`: it has a length, and a payload of any size up to a limit."""
    has_length = variable or rng.random() < 0.5
    header, pieces, id_bits = _identified(rng, variable=variable)
    if address[0]:
        header[address[0]] = {"role": "address", "type": address[1], **order(rng)}
    if has_length:
        header["length"] = {"type": rng.choice(("u8", "u8", "u16")), **order(rng)}
    names = list(header)
    rng.shuffle(names)
    parts: Doc = {"start": lead} | {name: header[name] for name in names}
    if has_length and not variable and rng.random() < 0.4:
        parts["again"] = {"type": parts["length"]["type"], "equals": "length", **_same_order(parts["length"])}
    if rng.random() < 0.3:
        parts["second"] = rng.choice((lead, "55"))
    most = rng.choice(_SIZES) if not variable else rng.choice((2, 8, 20, 60))
    if most or rng.random() < 0.5:
        parts["data"] = {"role": "payload", "size": f"0..{most}"}
    else:
        most, has_length = 0, False
        parts.pop("length", None)
        parts.pop("again", None)
    if has_length:
        _counted(rng, parts)
    _checked(rng, parts)
    if rng.random() < 0.4:
        parts["stop"] = rng.choice(("16", "03", "0D 0A"))
    shape = Shape(
        "kinds", {"parts": parts}, 0, most, id_bits, rng.choice(("master_slave", "host")), has_length
    )
    shape.address_name, shape.address_bits = address[0], int(address[1][1:] or 0)
    shape.pieces = pieces
    return shape


def _same_order(spec: Doc) -> Doc:
    return {key: spec[key] for key in ("byteorder",) if key in spec}


def _counted(rng: random.Random, parts: Doc) -> None:
    """What the length counts."""
    names = [name for name in parts if name == "data" or rng.random() < 0.3]
    parts["length"]["counts"] = names if len(names) > 1 else names[0]


def _checked(rng: random.Random, parts: Doc) -> None:
    """Check values, mostly one over the parts after the first."""
    if rng.random() < 0.85:
        found, width = draw_algorithm(rng)
        covered = [name for name in parts if rng.random() < 0.8] or [next(iter(parts))]
        parts["crc"] = {"type": width_type(width), "algorithm": found, "over": covered, **order(rng)}
    if "crc" in parts and rng.random() < 0.15:
        found, width = draw_algorithm(rng)
        covered = [name for name in parts if rng.random() < 0.5] or ["crc"]
        parts["also"] = {"type": width_type(width), "algorithm": found, "over": covered}


def _longer(rng: random.Random, shape: Shape, lead: str) -> Doc:
    """Another kind for the same messages, with longer payloads; the shape then has room for them."""
    parts: Doc = copy.deepcopy(shape.frame["parts"])
    parts["start"] = lead
    parts["length"]["type"] = rng.choice(("u16", "u24"))
    low = rng.choice((0, shape.most + 1, shape.most // 2))
    shape.most += rng.choice((1, 10, 100, 300))
    parts["data"]["size"] = f"{low}..{shape.most}"
    if "crc" in parts and rng.random() < 0.3:
        found, width = draw_algorithm(rng)
        parts["crc"] |= {"type": width_type(width), "algorithm": found}
    if rng.random() < 0.3:
        parts["last"] = "0A"
    return parts
