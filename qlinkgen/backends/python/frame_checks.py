"""Check values of frames: their functions, and the places of their bytes."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import assert_never

from qlinkgen.backends.python import integers
from qlinkgen.backends.python.check_views import CheckView, PlacedCheck
from qlinkgen.backends.python.layout import wrapped
from qlinkgen.model.checksum import Algorithm, Checksum, Fletcher, Sum, Xor, catalogue
from qlinkgen.plan.check import Check
from qlinkgen.plan.envelope import Envelope
from qlinkgen.plan.parts import CheckPart, Part, Seed


def check_view(check: Check, mark: str = "") -> CheckView:
    """The view of a check value."""
    algorithm = check.algorithm
    selectable = isinstance(algorithm, Algorithm) and algorithm.width == 16
    maker, arguments = maker_of(algorithm)
    definition = wrapped(f"_CHECKSUM{mark} = {maker}(", arguments, ")", 0)
    return CheckView(definition, check.size, check.regular or "", check_bytes(check), selectable, maker)


def maker_of(algorithm: Checksum) -> tuple[str, list[str]]:
    """The function of the support module that makes an algorithm, and its arguments."""
    name = f'"{algorithm.name}"'
    init = [] if not algorithm.init else [f"init={algorithm.init}"]
    match algorithm:
        case Sum():
            form = [] if algorithm.form == "plain" else [f'"{algorithm.form}"']
            if algorithm.carry:
                return "carried", [name, *form, *init]
            return "sum_of", [name, str(algorithm.width), *form, *init]
        case Xor():
            return "xor_of", [name, *(["16"] if algorithm.width == 16 else []), *init]
        case Fletcher(width=32, modulus=65521):
            return "adler", [name, *([] if algorithm.init == 1 else [f"init={algorithm.init}"])]
        case Fletcher():
            return "fletcher", [name, str(algorithm.half), str(algorithm.modulus), *init]
        case Algorithm(width=16) if algorithm in catalogue(16):
            return "find_crc", [name]
        case Algorithm():
            return "crc", [name, *_parameters(algorithm)]
        case _:
            assert_never(algorithm)


def _parameters(algorithm: Algorithm) -> list[str]:
    digits = (algorithm.width + 3) // 4
    numbers = {key: f"0x{getattr(algorithm, key):0{digits}X}" for key in ("poly", "init", "xorout")}
    return [
        f"width={algorithm.width}",
        f"poly={numbers['poly']}",
        f"init={numbers['init']}",
        f"refin={algorithm.refin}",
        f"refout={algorithm.refout}",
        f"xorout={numbers['xorout']}",
    ]


def check_bytes(check: Check, number: str = "crc") -> str:
    """Expression for the wire bytes of a check value."""
    if modulus := check.value.modulus:
        number = f"({number} % {modulus})" if check.algorithm.mask >= modulus else number
        return f'b"%0{check.size}d" % {number}'
    if check.value.base:
        return f'b"%0{check.size}X" % {number}'
    if check.regular:
        return f'{number}.to_bytes({check.size}, "{check.regular}")'
    groups = [integers.group_out(number, chunk) for chunk in check.value.chunks]
    return f"bytes(({', '.join(groups)}{',' if len(groups) == 1 else ''}))"


def placed(envelope: Envelope, part: CheckPart, mark: str, *, early: bool) -> PlacedCheck:
    """The view of a check value."""
    view = check_view(part.check, mark)
    start, end = _edge(envelope, part), _edge(envelope, part, after=True)
    covered = _covered(envelope, part, "frame")
    seeded, main = part in envelope.seeded, part is envelope.check
    checksum = "checksum" if main else f"_CHECKSUM{mark}"
    case = ".upper()" if part.check.value.base == 16 else ""
    result = f"crc = {checksum}.compute({covered}, {checksum}.start)"
    wrong = f"{view.bytes} != frame[{start}:{end}]{case}"
    if view.order and view.size <= 2:
        place = int(start or "0")
        wrong = f"crc != {integers.joined('frame', range(place, place + view.size), view.order)}"
    if part.check.otherwise is not None:
        given = f"frame{', message' if seeded else ''}{', checksum' if main else ''}"
        result = f"right = _check{mark}({given})"
        wrong = f"right != frame[{start}:{end}]{case}"
    return PlacedCheck(
        name=part.name,
        view=view,
        start=start,
        end=end,
        covered=covered,
        ahead="" if end else _covered(envelope, part, "body", "self", part.check.size),
        otherwise=part.check.otherwise,
        mark=mark,
        seeded=seeded,
        main=main,
        early=early and part in envelope.header_checks,
        result=result,
        wrong=wrong,
        case=case,
    )


def _covered(
    envelope: Envelope, part: CheckPart, data: str, message: str = "message", without: int = 0
) -> str:
    """Expression for the bytes that a check value covers, in a frame ``without`` its last bytes."""
    found = []
    for run in envelope.coverage(part):
        if isinstance(run, Seed):
            found.append(f"{message}.{seed_name(run)}")
            continue
        for group, always in _groups(envelope, run):
            first, after = _edge(envelope, group[0]), _edge(envelope, group[-1], after=True)
            cut = f"[{_nearer(first, without)}:{_nearer(after, without)}]"
            text = data if cut == "[:]" else data + cut
            found.append(text if always else f'({text} if _has_before({data}) else b"")')
    return " + ".join(found)


def _nearer(place: str, without: int) -> str:
    """A place counted from the end, if that is moved to the front."""
    number = int(place or "0")
    return str(number + without or "") if number < 0 else place


def _groups(envelope: Envelope, run: Sequence[Part]) -> Iterator[tuple[Sequence[Part], bool]]:
    """Adjacent parts of a frame, and whether it always has them."""
    extra = envelope.before.parts if envelope.before else ()
    for held, group in itertools.groupby(run, lambda part: part in extra):
        yield list(group), not held


def all_placed(envelope: Envelope, *, early: bool) -> tuple[list[PlacedCheck], list[PlacedCheck]]:
    """The views of all check values in wire order, and in the order in which they are computed.

    ``early``: those of the header alone are verified before the payload.
    """
    others = [part for part in envelope.checks if part is not envelope.check]
    views = {
        part.name: placed(envelope, part, f"_{others.index(part) + 2}" if part in others else "", early=early)
        for part in envelope.checks
    }
    return list(views.values()), [views[part.name] for part in envelope.filling]


def seed_name(seed: Seed) -> str:
    """The attribute of a message class that holds the bytes of a seed."""
    return f"SEED_{seed.attribute.upper()}"


def _edge(envelope: Envelope, part: Part, *, after: bool = False) -> str:
    """The beginning or end of a part in a slice of the frame."""
    if part is envelope.payload:
        place = -envelope.trailer_size if after else envelope.header_size
    elif part in envelope.front:
        place = envelope.offset(part) + (part.size if after else 0)
        return str(place) if place else ""
    else:
        place = -envelope.from_end(part) + (part.size if after else 0)
    return str(place) if place else ""
