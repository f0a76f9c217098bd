"""What an output leaves out: messages, and the enums and flags that none of the others has."""

from __future__ import annotations

import pytest

from qlinkgen.backends import python
from qlinkgen.plan import plan_of
from qlinkgen.plan.select import Options
from qlinkgen.schema import loads

_SCHEMA = """
qlinkgen: 1
protocol: {name: choice, title: Choice, revision: "1", source: Tests, doc: Something to choose from}
byteorder: big
frame:
  parts:
    start: {role: constant, value: AA}
    id: {role: message, type: u8}
    data: {role: payload, size: 0..8}
bus: {kind: master_slave}
defaults: {repeat: safe}
enums:
  mode: {type: u8, values: {slow: 1, fast: 2}}
  gear: {type: u8, values: {low: 1, high: 2}}
  idle: {type: u8, values: {none: 0}}
flags:
  state: {type: u8, values: {ready: 0}}
  fault: {type: u8, values: {hot: 0}}
  spare: {type: u8, values: {free: 0}}
commands:
  run: {id: 1, request: {m: mode}, response: {s: state}}
  shift: {id: 2, request: {g: gear}, response: {f: fault}}
"""


@pytest.mark.parametrize(
    ("only", "enums", "flags"),
    [
        ((), ["mode", "gear", "idle"], ["state", "fault", "spare"]),
        (("run",), ["mode"], ["state"]),
        (("shift.request",), ["gear"], []),
        (("run.response", "shift"), ["gear"], ["state", "fault"]),
    ],
)
def test_enums_and_flags_are_kept_with_their_messages(
    only: tuple[str, ...], enums: list[str], flags: list[str]
) -> None:
    protocol, _ = loads(_SCHEMA, "choice.yaml")
    assert protocol is not None
    plan = plan_of(protocol, Options(only=only))
    assert ([each.name for each in plan.enums], [each.name for each in plan.flags]) == (enums, flags)


@pytest.mark.parametrize(
    "more",
    [
        "replies: {end: {id: 4, fields: {}}}, many: {until: end}",
        "steps: [{receive: {id: 4, fields: {}}}, {send: {id: 5, fields: {}}}, {receive: response}]",
    ],
    ids=["answers up to a reply", "steps"],
)
def test_a_request_is_kept_with_all_that_its_master_must_know(more: str) -> None:
    text = f"{_SCHEMA}  log: {{id: 3, request: {{}}, response: {{s: u8}}, {more}}}\n"
    protocol, faults = loads(text, "choice.yaml")
    assert protocol is not None, faults
    assert python.load(protocol, Options(only=("log.request",))).COMMANDS.keys() == {"log"}
    request, command = (
        [each.name for each in plan_of(protocol, Options(only=(name,))).messages]
        for name in ("log.request", "log")
    )
    assert request == command
    assert len(command) > 1
