"""A node derived from the schema alone answers every command of every protocol with valid values."""

from __future__ import annotations

from pathlib import Path

import pytest

from qlinkgen.backends.python import load
from qlinkgen.link.codec import address_of, answers
from qlinkgen.link.slave import SlaveEngine
from qlinkgen.schema import load as load_schema
from qlinkgen.sim.generic import GenericNode, required_values
from tests.cli.wire import REPOSITORY

SCHEMAS = [
    REPOSITORY / "schemas" / "qlink.yaml",
    *sorted((REPOSITORY / "tests" / "schemas").glob("*.yaml")),
]


@pytest.mark.parametrize("path", SCHEMAS, ids=lambda path: path.stem)
def test_every_command(path: Path) -> None:
    codec = load(load_schema(path))
    number = codec.BUS.last_node
    node = GenericNode(codec, number)
    for command in codec.COMMANDS.values():
        address = codec.BUS.broadcast if command.addressing == "broadcast" else number
        request = command.request(**{command.request.ADDRESS: address}, **required_values(command.request))
        request.to_frame()
        response = node.handle(request, 0.0)
        if command.response is None:
            assert response is None
        else:
            assert response is not None
            assert codec.encode(response)
            assert answers(command, request, response)
            assert address_of(response) == number
    assert node.requests == len(codec.COMMANDS)


def test_what_it_repeats() -> None:
    codec = load(load_schema(REPOSITORY / "schemas" / "qlink.yaml"))
    response = GenericNode(codec, 4).handle(codec.LoopBackRequest(node=4, offset=3, data=b"abc"), 0.0)
    assert response == codec.LoopBackResponse(node=4, offset=3, data=b"abc")
    assert codec.ReadResponse(node=4, **required_values(codec.ReadResponse)).data == b"\0"


def test_a_message_of_no_command_is_not_answered() -> None:
    codec = load(load_schema(REPOSITORY / "tests" / "schemas" / "kitchen_sink.yaml"))
    node = GenericNode(codec, 4)
    engine = SlaveEngine(codec, node)
    engine.receive(codec.MESSAGES["hello"](station=4, serial=1).to_frame(), 0.0)
    assert node.requests == 1
    assert engine.next_timer() is None
