"""The model as data: what is made of it is the same, and nothing but models is made."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from qlinkgen.backends.python.module import render
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.stored import NotStorable, restore, store
from qlinkgen.plan import plan_of
from qlinkgen.schema import find, library, load, shipped

SCHEMAS = [
    *map(find, (*shipped(), *library())),
    *sorted((Path(__file__).parents[1] / "schemas").glob("*.yaml")),
]


def again(protocol: Protocol) -> Protocol:
    return restore(json.loads(json.dumps(store(protocol))))


@pytest.mark.parametrize("path", SCHEMAS, ids=lambda path: path.stem)
def test_every_schema(path: Path) -> None:
    protocol = load(path)
    found = again(protocol)
    assert found == protocol
    assert repr(found) == repr(protocol)
    for command, its in zip(protocol.commands, found.commands, strict=True):
        known = {id(message) for message in found.messages}
        assert {id(message) for message in its.messages} <= known, "the same object, not an equal one"
        assert its.attributes == command.attributes
    assert hash(found.messages[0].name) == hash(protocol.messages[0].name)


def test_the_same_code_is_generated() -> None:
    protocol = load(find("qlink"))
    assert render(plan_of(again(protocol))) == render(plan_of(protocol))


@pytest.mark.parametrize(
    "nodes",
    [
        [],
        [["()", 1]],
        [["nonsense.Protocol"]],
        [["protocol.Protocol"]],
        [["protocol.Fraction", 1, 2]],
        [["os.system", "true"]],
        [["..errors.Fault", "x"]],
        [["protocol.replace", 1]],
        [["()", [0, 5]]],
        [["()", [1, "zz"]]],
        [["()", [2, 1, 0]]],
        [["{}", 1]],
        [1],
        [[]],
    ],
)
def test_other_data_is_refused(nodes: Any) -> None:
    with pytest.raises(NotStorable):
        restore(nodes)


def test_other_objects_are_not_stored() -> None:
    with pytest.raises(NotStorable, match="Path is not a class of the model"):
        store(Path("x"))  # type: ignore[arg-type]
