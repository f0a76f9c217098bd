"""The check value: forms of a CRC, selectable algorithms, tables as literals."""

from __future__ import annotations

from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.c.names import unsigned, unsigned_type
from qlinkgen.errors import GenerationError
from qlinkgen.model.checksum import Algorithm, Checksum, Fletcher, Sum, Xor, catalogue

_FOLDED = (16, 0x1021)


def algorithm_macro(algorithm: Algorithm) -> str:
    """``crc-16/ibm-3740`` as part of the name of a macro: ``CRC_16_IBM_3740``."""
    return "".join(c if c.isalnum() else "_" for c in algorithm.name).upper()


@dataclass(frozen=True, slots=True, kw_only=True)
class SumView:
    """A check value that is not a CRC: start, the statements of a step, and its result.

    Attributes:
        key: what the names of its functions begin with, after the prefix of the protocol.
    """

    key: str
    name: str
    width: int
    type: str
    start: str
    step: list[str]
    finished: str


@dataclass(frozen=True, slots=True)
class Choice:
    """An algorithm that users of the header may select."""

    macro: str
    tuple: str
    check: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CrcView:
    """A CRC and the code of a step.

    Attributes:
        key: what the names of its functions begin with, after the prefix of the protocol.
        macros: the same of its macros.
        folds: its form may be that for the polynomial 0x1021, for which a byte takes a few shifts.
    """

    key: str
    macros: str
    name: str
    macro: str
    width: int
    type: str
    selectable: bool
    turned: bool
    folds: bool
    choices: list[Choice]
    poly: str
    feedback: str
    start: str
    xorout: str
    reflected: int
    shifted_down: str
    shifted_up: str
    top_byte: str
    placed_byte: str
    mask_open: str
    mask_close: str
    flash_read: str
    top: str
    nibble_shift: int
    nibble_rows: list[str]
    rows: list[str]


CheckView = SumView | CrcView


def field_check(number: int) -> str:
    """What the names of the functions of an algorithm of payloads begin with."""
    return f"field_check_{number}"


def render(algorithm: Checksum, number: int = 1) -> CheckView:
    """The check value for the template; users cannot replace an algorithm after the first.

    Raises:
        GenerationError: the CRC is not supported.
    """
    if number == 1:
        return _render("check", algorithm, "CRC")
    return _render(f"check_{number}", algorithm, f"CRC_{number}")


def render_of_fields(algorithm: Checksum, number: int) -> CheckView:
    """The check value of fields for the template.

    Raises:
        GenerationError: the CRC is not supported.
    """
    return _render(field_check(number), algorithm, f"FIELD_CRC_{number}")


def _render(key: str, algorithm: Checksum, macros: str) -> CheckView:
    match algorithm:
        case Sum():
            return _render_sum(key, algorithm, _sum_step(algorithm), finished(algorithm))
        case Xor():
            return _render_sum(key, algorithm, [_xor_step(algorithm)], "sum")
        case Fletcher():
            return _render_sum(key, algorithm, _fletcher_step(algorithm), "sum")
        case Algorithm():
            return _render_crc(key, algorithm, macros)
        case _:
            assert_never(algorithm)


def finished(algorithm: Sum) -> str:
    """The expression for the value of a ``sum``."""
    kind = unsigned_type(algorithm.width)
    return {"plain": "sum", "inverted": f"({kind})~sum", "zero": f"({kind})(0U - sum)"}[algorithm.form]


def _render_sum(key: str, algorithm: Sum | Xor | Fletcher, step: list[str], result: str) -> SumView:
    width, start = algorithm.width, unsigned(algorithm.start, algorithm.width)
    return SumView(
        key=key,
        name=algorithm.name,
        width=width,
        type=unsigned_type(width),
        start=start,
        step=step,
        finished=result,
    )


def _sum_step(algorithm: Sum) -> list[str]:
    if algorithm.carry:
        return [
            "const uint16_t total = (uint16_t)((uint16_t)sum + byte);",
            "return (uint8_t)((total & 0xFFU) + (total >> 8));",
        ]
    return [f"return ({unsigned_type(algorithm.width)})(sum + byte);"]


def _xor_step(algorithm: Xor) -> str:
    if algorithm.width == 16:
        return "return (uint16_t)((uint16_t)((uint16_t)(sum << 8) | (sum >> 8)) ^ byte);"
    return "return (uint8_t)(sum ^ byte);"


def _fletcher_step(algorithm: Fletcher) -> list[str]:
    """Both sums stay below the modulus, so one subtraction replaces a division."""
    kind, half = unsigned_type(algorithm.width), algorithm.half
    mask, modulus = (unsigned(each, algorithm.width) for each in ((1 << half) - 1, algorithm.modulus))
    return [
        f"{kind} low = ({kind})((sum & {mask}) + byte);",
        f"{kind} high = ({kind})(sum >> {half});",
        f"if (low >= {modulus}) {{",
        f"    low = ({kind})(low - {modulus});",
        "}",
        f"high = ({kind})(high + low);",
        f"if (high >= {modulus}) {{",
        f"    high = ({kind})(high - {modulus});",
        "}",
        f"return ({kind})(({kind})(high << {half}) | low);",
    ]


def _render_crc(key: str, algorithm: Algorithm, macros: str) -> CrcView:
    if algorithm.width not in (8, 16, 24, 32, 64):
        raise GenerationError(f"{algorithm.name}: not supported in C; use a CRC of whole bytes")
    turned = algorithm.refin != algorithm.refout
    selectable = algorithm.width == 16 and not turned and key == "check"
    width, kind = algorithm.width, unsigned_type(algorithm.width)
    # A CRC of 24 bits needs a mask in its wider type; one of 8 bits is shifted out completely.
    return CrcView(
        key=key,
        macros=macros,
        name=algorithm.name,
        macro=algorithm_macro(algorithm),
        width=width,
        type=kind,
        selectable=selectable,
        turned=turned,
        folds=selectable or (width, algorithm.poly) == _FOLDED,
        choices=[_choice(each) for each in _choices(algorithm)] if selectable else [],
        poly=unsigned(algorithm.poly, width, hexadecimal=True),
        feedback=unsigned(algorithm.feedback, width, hexadecimal=True),
        start=unsigned(algorithm.start, width, hexadecimal=True),
        xorout=unsigned(algorithm.xorout, width, hexadecimal=True),
        reflected=int(algorithm.refin),
        shifted_down="" if width == 8 else "(crc >> 8) ^ ",
        shifted_up="" if width == 8 else "(crc << 8) ^ ",
        top_byte="crc" if width == 8 else f"(crc >> {width - 8})",
        placed_byte="byte" if width == 8 else f"({kind})(({kind})byte << {width - 8})",
        mask_open="(" if width == 24 else "",
        mask_close=") & 0x00FFFFFFUL" if width == 24 else "",
        flash_read={8: "pgm_read_byte", 16: "pgm_read_word"}.get(width, "pgm_read_dword"),
        top=unsigned(1 << (width - 1), width, hexadecimal=True),
        nibble_shift=width - 4,
        nibble_rows=_rows(algorithm, 4),
        rows=_rows(algorithm, 8),
    )


def _choices(algorithm: Algorithm) -> list[Algorithm]:
    known = catalogue(algorithm.width)
    return [*known, *(() if algorithm in known else (algorithm,))]


def _choice(algorithm: Algorithm) -> Choice:
    width = algorithm.width
    numbers = [unsigned(value, width, hexadecimal=True) for value in (algorithm.poly, algorithm.init)]
    numbers += [str(int(algorithm.refin)), unsigned(algorithm.xorout, width, hexadecimal=True)]
    return Choice(algorithm_macro(algorithm), ", ".join(numbers), f"0x{algorithm.check:0{width // 4}X}")


def _rows(algorithm: Algorithm, bits: int) -> list[str]:
    entries = [unsigned(entry, algorithm.width, hexadecimal=True) for entry in algorithm.table(bits)]
    return [", ".join(entries[index : index + 8]) for index in range(0, len(entries), 8)]
