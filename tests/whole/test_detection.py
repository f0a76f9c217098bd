"""The comparison detects faults like those that generated code once had.

Each is planted in the text of one output, or in the vectors, and detected in the right stage.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from types import ModuleType

import pytest

from qlinkgen.backends import c, python
from qlinkgen.backends.base import Options, Outputs
from qlinkgen.backends.vectors import faults
from qlinkgen.model.protocol import Protocol
from tests.support.whole.trial import Effort, Outcome, run_text

_HEAD = """\
qlinkgen: 1
protocol: {name: tank, title: Tank, revision: "1", source: Example, doc: A tank}
byteorder: big
bus: {kind: master_slave}
"""
_BY_LENGTH = """\
frame:
  parts:
    start: {role: constant, value: 7E}
    length: {role: length, type: u8, counts: [data]}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..253}
    crc: {role: checksum, type: u16, algorithm: crc-16/modbus, over: [length, code, data]}
    end: {role: constant, value: 0D 0A}
"""
_BY_COUNT = """\
frame:
  parts:
    start: {role: constant, value: 7E}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..253}
    crc: {role: checksum, type: u8, algorithm: sum8, over: [code, data]}
"""
_UNCHECKED = """\
frame:
  parts:
    start: {role: constant, value: "68"}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..253}
"""
_GO = "  go: {id: 6, direction: request, fields: {level: {type: u32, range: 0..9}}}\n"


def _schema(frame: str, fields: str, more: str = "", direction: str = "direction: request, ") -> str:
    return f"{_HEAD}{frame}messages:\n  log: {{id: 5, {direction}fields: {{{fields}}}}}\n{more}"


@dataclass(frozen=True)
class Planted:
    """A fault.

    Attributes:
        schema: one with the code.
        pattern: the generated text, and its wrong replacement.
        found: stages and outputs, one of which must report it.
        target: the target of the text.
    """

    schema: str
    pattern: str
    replacement: str
    found: tuple[tuple[str, str], ...]
    target: ModuleType = python

    @property
    def effort(self) -> Effort:
        return Effort(uncompiled=self.target is python, sanitized=1)


PLANTED = {
    "a fixed run after a variable one is read at the wrong place": Planted(
        _schema(_BY_LENGTH, 'w: "u8[0..3]", q: "u8[3]"'),
        r"start = 3 \+ w_count",
        "start = 3",
        (("decode", "python"),),
    ),
    "a count is looked for in the message": Planted(
        _schema(_BY_LENGTH, 'x: "u8[2]", n: {type: u8, counts: b}, b: "u16[0..4]"'),
        r"(message\.b = .*)\{b_count\}",
        r"\1{message.b_count}",
        (("decode", "python"),),
    ),
    "a long array uses a name that was not imported": Planted(
        _schema(_BY_LENGTH, 'x: "u8[1..250]"'),
        "import Struct, pack, unpack_from|import Struct, unpack_from|import pack, unpack_from",
        "import Struct, pack",
        (("decode", "python"),),
    ),
    "a count is read past the end of a buffer": Planted(
        _schema(
            _BY_COUNT,
            'p: {type: u8, counts: a}, a: "bytes[0..40]", q: {type: u8, counts: b}, b: "bytes[0..40]"',
        ),
        r"if \(available < \(2U \+ a_count\)\) \{",
        "if (false) {",
        (("decode", "c"), ("stream", "c")),
        c,
    ),
    "a frame is kept after a fault that its check value proves": Planted(
        _schema(_BY_LENGTH, "v: {type: u8, range: 0..9}", _GO),
        r'proven = kind != "crc"',
        "proven = False",
        (("stream", "python"),),
    ),
    "a wrong constant at the end is passed over": Planted(
        _schema(_BY_LENGTH, "v: u8"),
        r'return "frame", end, b""',
        'return "no_frame", start, b""',
        (("stream", "python"), ("decode", "python")),
    ),
    "a frame waits for the byte after it": Planted(
        _schema(_BY_LENGTH, "v: u8"),
        r"self\._need = end - pos",
        "self._need = end - pos + 1",
        (("stream", "python"), ("cut stream", "python")),
    ),
    "noise in an unchecked frame takes the good ones after it": Planted(
        _schema(_UNCHECKED, "v: {type: u8, range: 0..9}", _GO),
        r"(?m)^( +)proven = False$",
        r"\1proven = True",
        (("stream", "python"),),
    ),
    "a header without directions names one": Planted(
        _schema(_BY_LENGTH, "v: u8", direction=""),
        r"(void tank_receiver_init\(.*\)\n\{)",
        r"\1\n    const int direction = TANK_MESSAGE;\n    (void)direction;",
        (("compile", "gcc -std=c99"), ("compile", "clang -std=c99")),
        c,
    ),
}


def _trial(schema: str, effort: Effort) -> Outcome:
    outcome = run_text(schema, effort=effort)
    assert not outcome.refused
    return outcome


def _stages(outcome: Outcome) -> set[tuple[str, str]]:
    return {(each.stage, each.who) for each in outcome.differences}


@pytest.mark.slow
@pytest.mark.parametrize("planted", PLANTED.values(), ids=PLANTED)
def test_a_planted_fault_is_found(planted: Planted, monkeypatch: pytest.MonkeyPatch) -> None:
    right = planted.target.generate

    def wrong(protocol: Protocol, options: Options) -> Outputs:
        outputs = dict(right(protocol, options))
        path = next(path for path in outputs if "tank" in path)
        outputs[path], count = re.subn(planted.pattern, planted.replacement, outputs[path])
        assert count, f"nothing is like {planted.pattern}: choose another place"
        return outputs

    monkeypatch.setattr(planted.target, "generate", wrong)
    assert _stages(_trial(planted.schema, planted.effort)) & set(planted.found)


@pytest.mark.slow
def test_a_vector_that_spoils_another_part_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """The kit then fails on a correct header."""
    right = faults.Faults.of

    def wrong(self: faults.Faults, good: faults.Good, *, first: bool) -> Iterator[faults.Bad]:
        for bad in right(self, good, first=first):
            spoilt = good.wire[:-1] + bytes((good.wire[-1] ^ 1,))
            yield replace(bad, wire=spoilt) if bad.kind == "crc" else bad

    schema = _schema(_BY_LENGTH, "v: u8")
    assert not _trial(schema, Effort()).differences
    monkeypatch.setattr(faults.Faults, "of", wrong)
    assert ("run", "kit gcc") in _stages(_trial(schema, Effort()))


@pytest.mark.slow
@pytest.mark.parametrize("schema", dict.fromkeys(each.schema for each in PLANTED.values()))
def test_nothing_is_found_where_nothing_is_planted(schema: str) -> None:
    assert not _trial(schema, Effort(sanitized=1)).differences
