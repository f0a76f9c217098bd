"""Every command of protocols of the library, called by its method on a bus with a simulated slave."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Iterator
from contextlib import aclosing, closing
from typing import Any

import pytest

from qlinkgen.model.naming import method
from qlinkgen.sim.joining import join
from qlinkgen.sim.smallest import required_values
from tests.bus.wires import bus_of, codec_of

#: Several answers of each kind, dialogues, other replies, silences, a link, frames with and without nodes.
NAMES = ("modbus_rtu", "ubx", "visca", "dnp3", "stm32", "dynamixel_2", "tmcl")


def commands_of(codec: Any) -> Iterator[tuple[Any, list[int], dict[str, Any]]]:
    """Each command with the address and the required values of a call.

    A frame of a dialogue after its request is an argument, too. Requests of records are left out.
    """
    for command in codec.COMMANDS.values():
        rules = {type(rule).__name__ for rule in command.request.RULES}
        if rules & {"RecordRule", "RecordsRule"}:
            continue
        node = codec.BUS.first_node
        values = required_values(command.request)
        for who, kind, _ in command.steps:
            if who == "send":
                address = {kind.ADDRESS: node} if kind.ADDRESS else {}
                values[kind.NAME.rpartition(".")[2]] = kind(**required_values(kind), **address)
        if listed := getattr(command.many, "each", ""):
            usual = command.request(**values, **{command.request.ADDRESS: node})
            values[listed] = type(getattr(usual, listed))([node])
        addressed = command.request.ADDRESS and command.addressing != "broadcast"
        yield command, [node] if addressed else [], values


def check(command: Any, answer: Any) -> None:
    """Check the kind of an answer."""
    if command.response is None:
        assert answer is None
    elif command.steps:
        assert [type(each) for each in answer] == [kind for who, kind, _ in command.steps if who == "receive"]
    elif hasattr(command.many, "each"):
        assert [type(each) for each in answer.values()] == [command.response]
    elif command.many is not None:
        assert answer
        assert {type(each) for each in answer} <= {command.response, command.many.reply}
    else:
        assert type(answer) is command.response


def asker(name: str, prefix: str = "") -> Any:
    """The class that asks."""
    module = bus_of(name)
    return next(
        getattr(module, prefix + each) for each in ("Bus", "Device", "Peer") if hasattr(module, prefix + each)
    )


@pytest.mark.parametrize("name", NAMES)
def test_blocking(name: str) -> None:
    codec, called = codec_of(name), 0
    with join(asker(name)) as pair:
        for command, where, values in commands_of(codec):
            faces = [(pair.master, where)]
            if where:
                faces.append((pair.master.node(*where), []))
            for face, address in faces:
                answer = getattr(face, method(command.name))(*address, **values)
                called += 1
                if hasattr(command.many, "stopped_by"):
                    with closing(answer) as each:
                        answer = list(itertools.islice(each, 2))
                check(command, answer)
        total = pair.master.engine.total
        assert (total.timeouts, total.failures, total.strays) == (0, 0, 0)
        assert total.requests >= called > 3


@pytest.mark.parametrize("name", NAMES)
def test_asyncio(name: str) -> None:
    async def run() -> None:
        with join(asker(name, "Async")) as pair:
            for command, where, values in commands_of(codec_of(name)):
                called = getattr(pair.master, method(command.name))(*where, **values)
                if hasattr(command.many, "stopped_by"):
                    async with aclosing(called) as each:
                        answer = [await anext(each), await anext(each)]
                else:
                    answer = await called
                check(command, answer)
            assert not pair.master.engine.total.timeouts

    asyncio.run(run())
