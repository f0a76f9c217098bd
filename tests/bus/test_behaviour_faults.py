"""What every bus does on a bad line, for each protocol of the library."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import Any, cast

import pytest

from qlinkgen.errors import BadReply, LinkError, NoReply
from qlinkgen.link.codec import Framed
from qlinkgen.link.events import Failed, Sent, Stray, TimedOut
from qlinkgen.link.gaps import ABANDONED
from qlinkgen.sim import FaultPlan
from qlinkgen.sim.fault_kinds import RateLike
from qlinkgen.sim.generic import GenericNode
from tests.bus.cases import ANSWERED, Case, cases_of, numbers_of
from tests.bus.rig import (
    Rig,
    Setting,
    after,
    beginning,
    both_ask,
    flipped,
    half,
    has_host,
    late,
    lost,
    wire_of,
)
from tests.bus.settings import VIRTUAL, everywhere, rig_for, timed
from tests.bus.wires import codec_of

#: Bytes of noise: none of them begins a frame of many protocols.
NOISE = bytes.fromhex("00 55 c3")
#: Chance of each kind of fault. One bit is changed: two can leave the sum of UBX or an XOR right.
HIGH = 0.3
RATES: dict[str, RateLike] = {
    **dict.fromkeys(("drop", "truncate", "delay", "duplicate", "stray", "noise"), HIGH),
    "flip": (HIGH, 1, 1),
}


@everywhere
def test_a_request_whose_answer_is_lost_is_repeated_where_that_is_safe(name: str, setting: Setting) -> None:
    for case in cases_of(name, *ANSWERED):
        if case.shape == "talk" and not setting.paced:
            continue  # the line has to be quiet for the slack of the host, longer than the slave waits
        for direction in ("requests", "answers"):
            with rig_for(case, setting) as rig:
                getattr(rig.script, direction).append(lost)
                if case.command.repeat_safe:
                    rig.ask_right(case)
                else:
                    with pytest.raises(NoReply) as caught:
                        rig.ask(case)
                    assert caught.value.attempts == 1
                repeats = int(case.command.repeat_safe)
                total = rig.master.engine.total
                assert (total.repeats, total.timeouts, total.failures) == (repeats, 1, 1 - repeats)
                rig.ask_right(case)


@everywhere
@pytest.mark.parametrize("fault", [lost, half], ids=["nothing", "half a frame"])
def test_no_answer_is_an_error_after_the_stated_attempts_and_time(
    name: str, setting: Setting, fault: Any
) -> None:
    for case in cases_of(name, *ANSWERED):
        for attempts in (1, 4):
            with rig_for(case, setting, attempts=attempts) as rig:
                rig.script.always = fault
                with pytest.raises((NoReply, BadReply) if fault is half else NoReply) as caught:
                    rig.ask(case)
                error, timing = caught.value, rig.timing
                tries = rig.tries(case, attempts)
                assert error.attempts == tries
                assert error.node == (case.node if case.where else rig_node(rig, case))
                first = case.deadline(timing)
                least = tries * first + (tries - 1) * timing.quiet
                assert least <= error.elapsed <= timing.worst_case(case.command, attempts)
                kinds = [type(each) for each in rig.events]
                if not rig.hosted:  # which also asks to come back in step
                    assert (kinds.count(Sent), kinds.count(TimedOut)) == (tries, tries)
                assert kinds.count(Failed) == 1
                rig.script.always = None
                rig.ask_right(case)


def rig_node(rig: Rig, case: Case) -> int | None:
    """The address of a request that has none of the caller's."""
    return rig.codec.BUS.broadcast if case.command.request.ADDRESS else None


@everywhere
def test_a_damaged_answer_is_never_taken_for_the_answer(name: str, setting: Setting) -> None:
    for case in cases_of(name, *ANSWERED, that=lambda case: case.checked):
        with rig_for(case, setting) as rig:
            rig.ask_right(case)
            size = 8 * max(len(wire_of(each)) for node in rig.nodes for each in node.made)
            for bit in range(0, size, 1 if setting is VIRTUAL[0] else 29):
                rig.script.answers.append(flipped(bit))
                try:
                    rig.ask_right(case)
                except LinkError:
                    assert not case.command.repeat_safe
            rig.script.answers.clear()
            rig.script.always = flipped(size - 1)
            with pytest.raises((BadReply, NoReply)) as caught:
                rig.ask(case)
            assert caught.value.attempts == rig.tries(case, rig.timing.attempts)
            rig.script.always = None
            rig.ask_right(case)


@timed
def test_a_late_answer_is_not_taken_for_the_next_one(name: str, setting: Setting) -> None:
    for case in cases_of(name, *ANSWERED):
        with rig_for(case, setting, attempts=1) as rig:
            first = case.deadline(rig.timing)
            rig.script.answers.append(late(first + rig.timing.quiet / 4, rig.timing.byte_time))
            with pytest.raises(NoReply):
                rig.ask(case)
            rig.ask_right(case)
            assert rig.master.engine.total.answers


@everywhere
def test_noise_before_an_answer_costs_a_repeat_at_most(name: str, setting: Setting) -> None:
    for case in cases_of(name, *ANSWERED, that=lambda case: case.checked and case.command.repeat_safe):
        for gap in (0.0, 0.004):
            with rig_for(case, setting) as rig:
                rig.script.answers.append(after(NOISE, gap))
                rig.ask_right(case)
                rig.ask_right(case)


@timed
def test_faults_at_random_give_no_wrong_answer(name: str, setting: Setting) -> None:
    rounds = 20 if setting.client == "blocking" else 4
    for case in cases_of(name, *ANSWERED, that=lambda case: case.checked):
        with rig_for(case, setting, attempts=6) as rig:
            quiet, within = rig.timing.quiet, case.deadline(rig.timing)
            late = within - rig.ask_own(case) * rig.timing.byte_time
            others = [*strays(rig.codec, case)]
            extents = {"late": (HIGH, late, late + quiet / 4), "silent": (HIGH, within, 3 * within)}
            for kind, rate in {**RATES, **extents}.items():
                plan = FaultPlan(**{kind: rate}, seed=7, strays=others)  # type: ignore[arg-type]
                rig.script.drawn, answered = plan, 0
                if kind == "stray" and not others:
                    continue
                for _ in range(rounds):
                    with suppress(LinkError):
                        rig.ask_own(case)
                        answered += 1
                    rig.master.port.sleep(quiet)  # a copy would pass for the answer to the next request
                assert answered >= rounds / 4 * case.command.repeat_safe, kind
            rig.script.drawn = None
            rig.ask_right(case)


@timed
def test_a_slave_hears_the_next_request_after_part_of_one(name: str, setting: Setting) -> None:
    for case in cases_of(name, *ANSWERED):
        with rig_for(case, setting, attempts=1) as rig:
            for size in range(1, 9):
                rig.script.requests.append(beginning(size))
                with suppress(LinkError):
                    rig.ask(case)
                rig.master.port.sleep(2 * ABANDONED)
                rig.ask_right(case)


@timed
def test_answers_of_others_are_passed_over(name: str, setting: Setting) -> None:
    codec = codec_of(name)
    for case in cases_of(name, "one"):
        for stray in strays(codec, case):
            with rig_for(case, setting) as rig:
                gap = rig.timing.idle + 4 * rig.timing.byte_time
                rig.script.answers.append(after(stray, gap))
                rig.ask_right(case)
                total = rig.master.engine.total
                assert (total.strays, total.timeouts) == (1, 0)
                assert any(type(each) is Stray for each in rig.events)


def strays(codec: Any, case: Case) -> Iterator[bytes]:
    """Answers of another node, and to another command."""
    if case.node is not None:
        yield example(codec, numbers_of(codec)[2], case.command)
    for other in cases_of(case.protocol, "one") if case.told_apart else ():
        if other.command.response is not case.command.response:
            yield example(codec, numbers_of(codec)[0], other.command)


def example(codec: Any, node: int, command: Any) -> bytes:
    """The frame of an answer."""
    answer = cast(Framed, GenericNode(codec, node).example(command))
    return answer.to_frame()


@timed
def test_its_own_bytes_are_not_an_answer(name: str, setting: Setting) -> None:
    for case in cases_of(name, *ANSWERED):
        if both_ask(name) or has_host(name):
            return  # its options have no echo
        with rig_for(case, setting, echoes=True) as rig:
            rig.ask_right(case)
            rig.script.always = lost
            with pytest.raises(NoReply):
                rig.ask(case)
            rig.script.always = None
            rig.ask_right(case)


@timed
def test_an_echo_that_nobody_expects_is_not_an_answer(name: str, setting: Setting) -> None:
    for case in cases_of(name, *ANSWERED, that=lambda case: case.told_apart and case.command.repeat_safe):
        if both_ask(name) or has_host(name):
            return  # its options have no echo
        # Where a silence ends a frame, the echo and the answer may be one: the host adds to the silence.
        with rig_for(case, setting, echoes=True, echo="none") as rig, suppress(LinkError):
            rig.ask_right(case)
