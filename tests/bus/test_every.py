"""Every command of protocols of the library, called by its method on a bus with a simulated slave."""

from __future__ import annotations

import asyncio
import itertools
from contextlib import aclosing, closing
from typing import Any

import pytest

from qlinkgen.model.naming import method
from qlinkgen.sim.joining import join
from tests.bus.cases import called
from tests.bus.wires import asker, codec_of

#: Several answers of each kind, dialogues, other replies, silences, a link, with and without nodes, a host.
NAMES = ("modbus_rtu", "ubx", "visca", "dnp3", "stm32", "dynamixel_2", "tmcl", "mc1231a")


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


@pytest.mark.parametrize("name", NAMES)
def test_blocking(name: str) -> None:
    codec, count = codec_of(name), 0
    with join(asker(name)) as pair:
        for command, where, values in called(codec, codec.BUS.first_node):
            faces = [(pair.master, where)]
            if where:
                one = getattr(getattr(codec, "RESYNC", None), "selected", "node")
                faces.append((getattr(pair.master, one)(*where), []))
            for face, address in faces:
                answer = getattr(face, method(command.name))(*address, **values)
                count += 1
                if hasattr(command.many, "stopped_by"):
                    with closing(answer) as each:
                        answer = list(itertools.islice(each, 2))
                check(command, answer)
        total = pair.master.engine.total
        assert (total.timeouts, total.failures, total.strays) == (0, 0, 0)
        assert total.requests >= count > 3


@pytest.mark.parametrize("name", NAMES)
def test_asyncio(name: str) -> None:
    codec = codec_of(name)

    async def run() -> None:
        with join(asker(name, "Async")) as pair:
            for command, where, values in called(codec, codec.BUS.first_node):
                answering = getattr(pair.master, method(command.name))(*where, **values)
                if hasattr(command.many, "stopped_by"):
                    async with aclosing(answering) as each:
                        answer = [await anext(each), await anext(each)]
                else:
                    answer = await answering
                check(command, answer)
            assert not pair.master.engine.total.timeouts

    asyncio.run(run())
