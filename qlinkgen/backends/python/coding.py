"""Prints codings: statements that code and decode the local ``data``, fast where nothing is to do."""

from __future__ import annotations

from typing import assert_never

from qlinkgen._dataclass import dataclass
from qlinkgen.backends.python.layout import literal
from qlinkgen.plan.coding import Add, Cobs, Digits, Escaping, Insertion, Pair, Stage


@dataclass(frozen=True, slots=True)
class CodingView:
    """The statements of codings.

    Attributes:
        tables: definitions.
        encode: replace ``data`` by the coded bytes.
        decode: replace it by the decoded bytes, or return None.
        take: append bytes of ``buf`` from ``at`` to ``frame`` up to ``size``; of one coding.
    """

    tables: list[str]
    encode: list[str]
    decode: list[str]
    take: list[str]


def coding_view(stages: tuple[Stage, ...], mark: str = "") -> CodingView:
    """The statements of codings that apply one after the other; the names of tables end with ``mark``."""
    numbers = [f"_{index}" if len(stages) > 1 else "" for index in range(1, len(stages) + 1)]
    views = [_view(stage, mark + number) for stage, number in zip(stages, numbers, strict=True)]
    return CodingView(
        tables=[line for view in views for line in view.tables],
        encode=[line for view in views for line in view.encode],
        decode=[line for view in reversed(views) for line in view.decode],
        take=views[0].take,
    )


def _view(stage: Stage, suffix: str) -> CodingView:
    match stage:
        case Escaping():
            return _escaping(stage, f"_UNESCAPED{suffix}")
        case Insertion():
            return _insertion(stage)
        case Cobs():
            return CodingView([], _COBS, _UNCOBS, [])
        case Digits():
            decode = ["try:", "    data = unhexlify(data)", "except ValueError:", "    return None"]
            return CodingView([], ["data = hexlify(data).upper()"], decode, _TAKE_DIGITS)
        case Pair():
            return _pair(f"_INVERTED{suffix}")
        case Add():
            table = f"_ADDED{suffix}", f"_SUBTRACTED{suffix}"
            numbers = stage.number, -stage.number % 256
            return CodingView(
                [
                    f"{name} = bytes((byte + {number}) % 256 for byte in range(256))"
                    for name, number in zip(table, numbers, strict=True)
                ],
                [f"data = data.translate({table[0]})"],
                [f"data = data.translate({table[1]})"],
                [
                    "data = buf[at : at + size - len(frame)]",
                    f"frame += data.translate({table[1]})",
                    "at += len(data)",
                ],
            )
        case _:
            assert_never(stage)


def _escaping(stage: Escaping, table: str) -> CodingView:
    escape = literal(bytes((stage.escape,)))
    # The escape byte first: the others add it.
    codes = sorted(stage.codes, key=lambda code: code[0] != stage.escape)
    encode = []
    for byte, second in codes:
        pair = literal(bytes((stage.escape, second)))
        encode.append(f"data = data.replace({literal(bytes((byte,)))}, {pair})")
    if stage.mask:
        definition = f"{table} = [bytes((byte ^ {stage.mask},)) for byte in range(256)]"
    else:
        rows = ", ".join(f"0x{second:02X}: {literal(bytes((byte,)))}" for byte, second in stage.codes)
        definition = f"{table} = {{{rows}}}"
    decode = [
        f"if {escape} in data:",
        f"    data, *runs = data.split({escape})",
        "    try:",
        f'        data += b"".join([{table}[run[0]] + run[1:] for run in runs])',
        "    except LookupError:",
        "        return None",
    ]
    return CodingView([definition], encode, decode, _take_escaped(stage, table, escape))


def _take_escaped(stage: Escaping, table: str, escape: str) -> list[str]:
    wrong = f"second == 0x{stage.escape:02X}" if stage.mask else f"second not in {table}"
    return [
        "while len(frame) < size and at < len(buf):",
        "    left = size - len(frame)",
        f"    mark = buf.find({escape}, at, at + left)",
        "    stop = at + left if mark < 0 else mark",
        "    frame += buf[at:stop]",
        "    at = min(stop, len(buf))",
        "    if mark >= 0:",
        "        if at + 1 == len(buf):",
        '            return frame, at + 1, ""',
        "        second = buf[at + 1]",
        f"        if {wrong}:",
        '            return frame, at + 2, "stuffing"',
        f"        frame += {table}[second]",
        "        at += 2",
    ]


def _insertion(stage: Insertion) -> CodingView:
    after, both = literal(stage.after), literal(stage.inserted)
    decode = [
        f"if {after} in data:",
        f"    plain = data.replace({both}, {after})",
        f"    if plain.replace({after}, {both}) != data:",
        "        return None",
        "    data = plain",
    ]
    return CodingView([], [f"data = data.replace({after}, {both})"], decode, [])


def _pair(table: str) -> CodingView:
    encode = [
        "pairs = bytearray(2 * len(data))",
        "pairs[::2] = data",
        f"pairs[1::2] = data.translate({table})",
        "data = bytes(pairs)",
    ]
    decode = [
        "plain = data[::2]",
        f"if data[1::2] != plain.translate({table}):",
        "    return None",
        "data = plain",
    ]
    take = [
        "pairs = buf[at : at + 2 * (size - len(frame))]",
        f"plain, inverted = pairs[::2], pairs[1::2].translate({table})",
        "if not plain.startswith(inverted):",
        "    wrong = next(n for n, byte in enumerate(inverted) if byte != plain[n])",
        '    return frame + plain[:wrong], at + 2 * wrong + 2, "stuffing"',
        "frame += inverted",
        "at += len(pairs)",
    ]
    return CodingView([f"{table} = bytes(range(255, -1, -1))"], encode, decode, take)


_TAKE_DIGITS = [
    "digits = buf[at : at + 2 * (size - len(frame))]",
    'right = len(digits) - len(digits.lstrip(b"0123456789ABCDEFabcdef"))',
    "frame += unhexlify(digits[: right & ~1])",
    "if right < len(digits):",
    '    return frame, at + right + 1, "stuffing"',
    "at += len(digits)",
]


_COBS = [
    'pieces, runs = [], data.split(b"\\0")',
    "for number, run in enumerate(runs):",
    "    at = 0",
    "    while len(run) - at >= 254:",
    '        pieces.append(b"\\xff" + run[at : at + 254])',
    "        at += 254",
    "    # A full block does not imply a zero.",
    "    if at == 0 or at < len(run) or number < len(runs) - 1:",
    "        pieces.append(bytes((len(run) - at + 1,)) + run[at:])",
    'data = b"".join(pieces)',
]
_UNCOBS = [
    "pieces, at = [], 0",
    "while at < len(data):",
    "    size = data[at]",
    "    run = data[at + 1 : at + size]",
    '    if size == 0 or len(run) < size - 1 or b"\\0" in run:',
    "        return None",
    "    at += size",
    "    pieces.append(run)",
    "    if size < 255 and at < len(data):",
    '        pieces.append(b"\\0")',
    'data = b"".join(pieces)',
]
