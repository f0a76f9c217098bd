"""What every bus does on a good line, for each protocol of the library."""

from __future__ import annotations

import asyncio
from itertools import pairwise
from typing import Any, cast, get_args

import pytest

from qlinkgen.errors import PortLost, Refused
from qlinkgen.link.codec import Framed
from qlinkgen.link.events import Answered
from qlinkgen.schema import find, library, load
from tests.bus.cases import ANSWERED, Case, Shape, cases_of
from tests.bus.rig import Rig, Setting, late, lost
from tests.bus.settings import NAMES, everywhere, rig_for, tasks
from tests.bus.wires import codec_of


def test_every_protocol_is_tried() -> None:
    """So is every kind of command, of which each protocol has one."""
    assert set(NAMES) == {name for name in library() if load(find(name)).commands} | {"qlink", "mc1231a"}
    shapes = [{case.shape for case in cases_of(name, *get_args(Shape))} for name in NAMES]
    assert all(shapes)
    assert set().union(*shapes) == set(get_args(Shape))


@everywhere
def test_an_answer_is_told_with_its_values(name: str, setting: Setting) -> None:
    for case in cases_of(name, *ANSWERED):
        with rig_for(case, setting) as rig:
            for _ in range(3):
                rig.ask_right(case)
            total = rig.master.engine.total
            assert total.requests == 3
            assert (total.repeats, total.timeouts, total.failures, total.strays, total.damaged) == (
                0,
                0,
                0,
                0,
                {},
            )
            assert sum(type(each) is Answered for each in rig.events) == 3


@everywhere
def test_a_refusal_is_raised_at_once_with_its_reply(name: str, setting: Setting) -> None:
    for case in cases_of(name, *ANSWERED, that=lambda case: case.refusable):
        with rig_for(case, setting, refused=case.command.name) as rig:
            with pytest.raises(Refused) as caught:
                rig.ask(case)
            error, reply = caught.value, cast(Framed, caught.value.reply)
            assert error.attempts == 1
            assert type(error.request) is case.command.request
            assert type(reply) in case.command.replies
            assert error.reason
            assert reply.to_frame() in [each.to_frame() for node in rig.nodes for each in node.made]
            total = rig.master.engine.total
            assert (total.requests, total.refusals, total.failures, total.timeouts) == (1, 1, 0, 0)


@everywhere
def test_a_request_to_all_reaches_all_and_has_no_answer(name: str, setting: Setting) -> None:
    for case in cases_of(name, "one", "told", that=lambda case: case.to_all):
        if case.command.addressing == "broadcast":
            everybody = case
        else:
            everybody = Case(name, case.command, [codec_of(name).BUS.broadcast], case.values)
        with rig_for(case, setting) as rig:
            for _ in range(2):
                assert rig.ask(everybody) is None
            rig.settle()
            assert [len(node.heard) for node in rig.nodes] == [2] * len(rig.nodes)
            assert not rig.master.engine.total.timeouts
            if setting.paced:
                ends_and_begins = [(end, begin) for (_, end), (begin, _) in pairwise(rig.sent)]
                assert all(
                    begin - end >= rig.timing.gap(case.command) - 1e-9 for end, begin in ends_and_begins
                )


@everywhere
def test_a_request_without_an_answer_does_not_wait_for_one(name: str, setting: Setting) -> None:
    for case in cases_of(name, "told"):
        with rig_for(case, setting) as rig:
            begun = rig.master.port.now()
            assert rig.ask(case) is None
            if setting.paced:
                assert rig.master.port.now() == begun
            rig.settle()
            heard = [each for node in rig.nodes for each in node.heard]
            assert {type(each) for each in heard} == {case.command.request}


@everywhere
def test_closing_ends_a_call_that_waits(name: str, setting: Setting) -> None:
    for case in cases_of(name, *ANSWERED)[:1]:
        with rig_for(case, setting) as rig:

            def close(data: bytes) -> Any:
                rig.master.close()
                return lost(data)

            rig.script.requests.append(close)
            for _ in range(2):
                with pytest.raises(PortLost):
                    rig.ask(case)


@tasks
def test_after_a_cancelled_call_the_next_one_gets_its_own_answer(name: str, setting: Setting) -> None:
    for case in cases_of(name, *ANSWERED):
        with rig_for(case, setting) as rig:

            async def run(rounds: int, rig: Rig = rig, case: Case = case) -> None:
                if setting.paced and rounds % 2:  # it has waited to the end when it is cancelled
                    seconds = case.deadline(rig.timing) + rig.timing.quiet / 4
                    rig.script.answers.append(late(seconds, rig.timing.byte_time))
                task = asyncio.ensure_future(rig.call(case))
                for _ in range(rounds):
                    await asyncio.sleep(0)
                task.cancel()
                await asyncio.wait([task])
                rig.script.answers.clear()
                for node in rig.nodes:
                    node.made.clear()
                rig.check(await rig.call(case))

            for rounds in range(6):
                rig.run(lambda rounds=rounds: run(rounds))  # type: ignore[misc]
            assert not rig.master.engine.total.failures


@tasks
def test_the_calls_of_a_transaction_are_not_interleaved(name: str, setting: Setting) -> None:
    for case in cases_of(name, *ANSWERED, "told")[:1]:
        with rig_for(case, setting) as rig:
            order: list[str] = []

            async def run(rig: Rig = rig, case: Case = case, order: list[str] = order) -> None:
                async def other() -> None:
                    await rig.call(case)
                    order.append("other")

                waiting = asyncio.create_task(other())
                async with rig.master.transaction():
                    for _ in range(3):
                        await asyncio.sleep(0)
                        await rig.call(case)
                        order.append("mine")
                await waiting

            rig.run(run)
            assert order == ["mine"] * 3 + ["other"]
