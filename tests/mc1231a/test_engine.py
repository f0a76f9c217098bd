"""The host engine alone: transmissions, waits, repeats, and resynchronisation."""

from __future__ import annotations

import contextlib
import random
from collections.abc import Iterable
from typing import Any

import pytest

from qlinkgen.codecs import mc1231a
from qlinkgen.codecs.mc1231a import AxisStatus
from qlinkgen.errors import BadReply, IllegalCommand, LinkError, NoReply
from qlinkgen.link.events import Damaged, Failed, Sent, TimedOut
from qlinkgen.link.host_events import Filled, InStep, OutOfStep
from qlinkgen.link.host_timing import HostTiming
from qlinkgen.link.transaction import Packet
from qlinkgen.protocols.mc1231a import ChipEngine, ChipSet
from qlinkgen.protocols.mc1231a.facts import SELECT
from tests.mc1231a.line import BAUD, BYTE, SLACK, Device, Line, chip_device, make, on_axis, sample

GET_KP = mc1231a.GetKpRequest()
UPDATE = mc1231a.UpdateRequest()
COMMANDS: dict[str, Any] = dict(mc1231a.COMMANDS)
WRITES = [command for command in COMMANDS.values() if command.request.MAX_SIZE]


def chip_line(
    *, forgets: float = 0.0, host_forgets: float | None = None, **options: Any
) -> tuple[Line, ChipEngine]:
    chip = ChipEngine(ChipSet(), forgets=forgets, record=True)
    engine = make(forgets=forgets if host_forgets is None else host_forgets, **options)
    return Line(engine, chip_device(chip)), chip


def spoiled(device: Device, changes: Iterable[tuple[int, bytes | None, bytes | None]]) -> Device:
    """A device to which, and from which, some pieces come changed: (number of the piece, there, back)."""
    table = {number: (there, back) for number, there, back in changes}
    count = iter(range(1_000_000))

    def changed(data: bytes, now: float) -> list[tuple[float, bytes]]:
        there, back = table.get(next(count), (None, None))
        answers = device(data if there is None else there, now) if there != b"" else []
        if back is None:
            return answers
        return [(answers[0][0] if answers else now, back)] if back else []

    return changed


# What a driver may do


def test_one_transaction_at_a_time_and_only_requests() -> None:
    engine = make()
    with pytest.raises(RuntimeError, match="no finished transaction"):
        engine.take()
    response: Any = mc1231a.GetKpResponse()
    with pytest.raises(TypeError, match="GetKpResponse is not a request"):
        engine.start(response, 0.0)
    with pytest.raises(ValueError, match="1 or more"):
        engine.start(GET_KP, 0.0, attempts=0)
    with pytest.raises(mc1231a.EncodeError):
        engine.start(mc1231a.SetKpRequest(value=-1), 0.0)
    engine.start(GET_KP, 0.0)
    assert engine.busy
    with pytest.raises(RuntimeError, match="one at a time"):
        engine.start(GET_KP, 0.0)


def test_events_of_a_good_transaction() -> None:
    line, _ = chip_line()
    reply = line.ask(on_axis(GET_KP, 2))
    assert (reply.response, reply.attempts) == (mc1231a.GetKpResponse(value=0), 1)
    assert [type(event).__name__ for event in line.engine.events] == ["Sent", "Sent", "Answered"]
    first, second, _ = line.engine.events
    assert isinstance(first, Sent)
    assert isinstance(second, Sent)
    assert (first.frame, second.frame) == (b"\x02", b"\x50")
    assert line.engine.total.as_dict() == {
        **dict.fromkeys(line.engine.total.as_dict(), 0),
        "requests": 2, "answers": 1, "contexts": 1, "damaged": {},
    }  # fmt: skip
    line.engine.events.clear()
    line.engine.verbose = False
    line.ask(on_axis(GET_KP, 2))
    assert not line.engine.events


def test_a_raw_request_goes_to_whatever_is_current() -> None:
    line, _ = chip_line()
    line.ask(mc1231a.SetKpRequest(value=3))
    assert line.sent == [b"\x25\0\3"]


def test_bytes_between_the_call_and_its_first_packet() -> None:
    """The host is out of step before it has sent anything: it gets back in step first, and then asks."""
    line, _ = chip_line()
    engine = line.engine
    start = engine.start

    def disturbed_start(*args: Any, **options: Any) -> None:
        start(*args, **options)
        engine.receive(b"?", line.now)

    engine.start = disturbed_start  # type: ignore[method-assign]
    reply = line.ask(on_axis(GET_KP, 2))
    assert (reply.response, reply.attempts) == (mc1231a.GetKpResponse(value=0), 1)
    assert engine.in_step
    assert [type(event) for event in engine.events if isinstance(event, OutOfStep | InStep)] == [
        OutOfStep,
        InStep,
    ]


# Checksums


def test_a_wrong_checksum_is_a_reason_to_repeat() -> None:
    line, _ = chip_line()
    line.device = spoiled(line.device, [(0, None, b"\0\0\0\x51")])
    reply = line.ask(GET_KP)
    assert reply.attempts == 2
    assert line.engine.total.damaged == {"crc": 1}
    kinds = [type(event) for event in line.engine.events if type(event) is not Sent]
    assert kinds[:4] == [Damaged, OutOfStep, Filled, InStep]


def test_illegal_is_told_from_corrupted() -> None:
    line, _ = chip_line()
    line.device = spoiled(line.device, [(0, None, b"\0\0\0\0")])
    assert line.ask(GET_KP).attempts == 2  # a zero that does not come again was none of the chip set's
    chip = ChipEngine(ChipSet(illegal=["get_kp", "update"]))
    line = Line(make(), chip_device(chip))
    error = line.fails(GET_KP)
    assert (type(error), error.attempts) == (IllegalCommand, 3)
    error = line.fails(UPDATE)
    assert (type(error), error.attempts) == (IllegalCommand, 1)
    assert line.sent.count(b"\x1a") == 1
    assert line.engine.total.illegal == 4


def test_a_chip_set_that_does_not_know_the_words_of_a_command_either() -> None:
    line, _ = chip_line()
    device = line.device
    line.device = lambda data, now: [(now + BYTE, b"\0\0")] if data == b"\x50" else device(data, now)
    error = line.fails(GET_KP)
    assert type(error) is IllegalCommand
    line.ask(mc1231a.SetKpRequest(value=1))


def test_some_refusals_and_some_corruption_are_no_refusal() -> None:
    line, _ = chip_line()
    line.device = lambda data, now: [(now + BYTE, b"\1\2\3\4")] if data == b"\x50" else []
    error = line.fails(GET_KP, attempts=1)
    assert type(error) is BadReply
    assert error.received == b"\1\2\3\4"


def test_refused_once_and_damaged_once_is_damaged() -> None:
    answers = iter([b"\0\0\0\0", b"\1\2\3\4", b"\0\0\0\0"])
    line, _ = chip_line()
    device = line.device
    line.device = lambda data, now: [(now + BYTE, next(answers))] if data == b"\x50" else device(data, now)
    assert type(line.fails(GET_KP)) is BadReply


def test_zero_is_right_where_zero_is_the_sum() -> None:
    line, _ = chip_line()
    line.ask(mc1231a.SetPosRequest(value=-15))  # 0x10 + 0xFFFF + 0xFFF1
    assert line.engine.total.illegal == 0


def test_a_value_that_cannot_be_is_damage_although_its_sum_is_right() -> None:
    line, _ = chip_line()
    line.device = lambda data, now: [(now, bytes.fromhex("ffff 0006"))] if data == b"\x07" else []
    assert type(line.fails(mc1231a.GetMtrLmtRequest(), attempts=1)) is BadReply


# Repeats


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_what_must_not_be_repeated_is_sent_once(command: Any) -> None:
    line = Line(make(), lambda _data, _now: [])
    error = line.fails(sample(command))
    assert type(error) is NoReply
    assert error.attempts == 1  # nothing ever answers, so not even getting in step succeeds
    frame = line.sent[0]
    assert line.sent.count(frame) == 1 or command.name == "set_1"  # which is also a proof


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_what_may_be_repeated_is(command: Any) -> None:
    line, chip = chip_line()
    line.device = spoiled(line.device, [(0, None, b"")])
    request = sample(command)
    if command.repeat_safe:
        assert line.ask(request).attempts == 2
    else:
        error = line.fails(request)
        assert (type(error), error.attempts) == (NoReply, 1)
        assert "may have been executed" in str(error)
        assert chip.record == [request.to_frame()]
    line.ask(GET_KP)


def test_attempts_are_all_tries() -> None:
    line, _ = chip_line(attempts=5)
    line.device = spoiled(line.device, [(0, None, b"")])
    assert line.fails(GET_KP, attempts=1).attempts == 1
    line.device = spoiled(line.device, [(0, None, b""), (4, None, b""), (8, None, b""), (12, None, b"")])
    line.ask(GET_KP)  # gets back in step
    assert line.engine.in_step


# Getting back in step


@pytest.mark.parametrize("forgets", [0.0, 0.003])
@pytest.mark.parametrize("command", WRITES, ids=lambda command: command.name)
def test_any_bytes_may_get_lost_on_the_way_there(command: Any, forgets: float) -> None:
    """Whatever is left of a packet: the host is in step again, and what may be repeated is done."""
    request = sample(command)
    frame = request.to_frame()
    for left in {frame[:at] + frame[at + size :] for size in (1, 2, 3) for at in range(len(frame))}:
        line, chip = chip_line(forgets=forgets)
        line.device = spoiled(line.device, [(0, left, None)])
        try:
            line.ask(request)
        except LinkError:
            assert not command.repeat_safe
        line.ask(on_axis(GET_KP))
        assert line.engine.in_step
        assert chip.record
        assert chip.record[-1] == b"\x50"
        assert chip.counters.forgotten <= 1


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_any_bytes_may_get_lost_on_the_way_back(command: Any) -> None:
    request = sample(command)
    size = command.response.MAX_WIRE_SIZE
    chip = ChipEngine(ChipSet())
    chip.receive(request.to_frame(), 0.0)
    answer = chip.bytes_to_send(0.0)
    for cut in range(size):
        for left in (answer[:cut], answer[:cut] + answer[cut + 1 :], answer[cut + 1 :]):
            line, _ = chip_line()
            line.device = spoiled(line.device, [(0, None, left)])
            try:
                line.ask(request)
            except LinkError:
                assert not command.repeat_safe
            line.ask(GET_KP)
            assert line.engine.in_step


@pytest.mark.parametrize(("mask", "lost"), [(0xFFFE, 0), (0x0001, 1), (0xFFFF, 2), (0x0000, 1)])
def test_filling_up_a_mask_clears_no_event(mask: int, lost: int) -> None:
    """In the masks of rst_status and rst_intrpt a zero clears an event, so ones are filled in."""
    for request in (mc1231a.RstStatusRequest(mask=mask), mc1231a.RstIntrptRequest(mask=mask)):
        line, chip = chip_line()
        axis = chip.chip.axes[1]
        axis.raise_event(AxisStatus.POSITIVE_LIMIT | AxisStatus.MOTION_ERROR)
        axis.write("intrpt_mask", 0xFFFF)
        frame = request.to_frame()
        line.device = spoiled(line.device, [(0, frame[:lost] + frame[lost + 1 :], None)])
        line.fails(request)
        line.ask(GET_KP)
        if lost:  # else the mask itself was taken for commands
            kept = mask & 0xFF if lost == 1 else mask >> 8
            filled = kept << 8 | 0xFF
            assert axis.events == (AxisStatus.POSITIVE_LIMIT | AxisStatus.MOTION_ERROR) & filled
            assert filled | 0xFF00 == 0xFFFF  # bits 0 to 7 were never cleared


@pytest.mark.parametrize("lost", [1, 2])
def test_filling_up_a_multi_update_updates_no_axis(lost: int) -> None:
    line, chip = chip_line()
    for axis in chip.chip.axes.values():
        axis.write("kp", 5)
    frame = mc1231a.MultiUpdateRequest(axes=3).to_frame()
    line.device = spoiled(line.device, [(0, frame[:lost] + frame[lost + 1 :], None)])
    line.fails(mc1231a.MultiUpdateRequest(axes=3))
    line.ask(GET_KP)
    done = [axis.active["kp"] for axis in chip.chip.axes.values()]
    assert done == [0, 0]


def test_a_chip_set_that_forgets_carries_nothing_out_by_filling_up() -> None:
    line, chip = chip_line(forgets=0.003)
    line.device = spoiled(line.device, [(0, bytes.fromhex("4d 00 00 01"), None)])  # set_actl_pos, a byte lost
    line.ask(mc1231a.SetActlPosRequest(value=0x123))
    assert chip.record is not None
    assert [packet.hex() for packet in chip.record if packet[0] == 0x4D] == ["4d00000123"]
    assert chip.counters.forgotten == 1
    assert line.engine.total.completed == 0


def test_without_such_a_rule_the_broken_packet_is_carried_out_and_told_of() -> None:
    line, chip = chip_line()
    line.device = spoiled(line.device, [(0, bytes.fromhex("4d 00 00 01"), None)])
    line.ask(mc1231a.SetActlPosRequest(value=0x123))
    assert chip.record is not None
    assert [packet.hex() for packet in chip.record if packet[0] == 0x4D] == ["4d00000100", "4d00000123"]
    assert line.engine.total.completed == 1
    assert [event.completed for event in line.engine.events if isinstance(event, InStep)] == [True]


def test_a_device_that_says_nothing_to_what_is_no_command() -> None:
    line, chip = chip_line()
    device = line.device

    def silent(data: bytes, now: float) -> list[tuple[float, bytes]]:
        whole = chip_is_at_a_boundary(chip)
        return [] if data == b"\0" and whole else device(data, now)

    line.device = spoiled(silent, [(0, b"\x10\0", None)])
    line.ask(mc1231a.SetPosRequest(value=77))
    assert line.engine.in_step
    assert chip.chip.axes[1].values["pos"] == 77


def chip_is_at_a_boundary(chip: ChipEngine) -> bool:
    decoder: Any = chip._decoder
    return not decoder._buffer


def test_a_late_answer_never_answers_the_next_question() -> None:
    """Whenever it comes: nothing is taken for the answer to something else."""
    for late in (0.0005 * step for step in range(1, 200)):
        line, chip = chip_line()
        chip.chip.axes[1].write("kp", 111)
        chip.chip.axes[2].write("kp", 222)
        device, held = line.device, [0.0]

        def delayed(
            data: bytes, now: float, device: Device = device, held: list[float] = held
        ) -> list[tuple[float, bytes]]:
            answers = device(data, now)
            held[0] = max(held[0], *(at for at, _ in answers), 0.0)
            return [(max(at, held[0]), answer) for at, answer in answers]

        line.device = delayed
        line.ask(on_axis(GET_KP, 1))
        held[0] = line.now + late
        for axis, value in ((1, 111), (2, 222), (1, 111), (2, 222)):
            for _ in range(30):
                try:
                    assert line.ask(on_axis(GET_KP, axis)).response.value == value, late
                    break
                except LinkError:
                    continue
            else:
                raise AssertionError(f"{late} s late: never in step again")


def test_bytes_that_nobody_asked_for() -> None:
    line, _ = chip_line()
    line.ask(on_axis(GET_KP))
    line.engine.receive(b"\0\x1a", line.now)  # noise may have made an update of itself
    assert not line.engine.in_step
    assert [event.reason for event in line.engine.events if isinstance(event, OutOfStep)] == [
        "unsolicited bytes"
    ]
    line.sent.clear()
    line.ask(on_axis(GET_KP))
    assert line.sent == [b"\0", b"\x01", b"\x31", b"\x50"]


def test_more_than_the_answer() -> None:
    line, _ = chip_line()
    line.device = spoiled(line.device, [(0, None, b"\0\0\0\x50\0")])
    assert line.ask(GET_KP).attempts == 1
    assert not line.engine.in_step
    line.ask(GET_KP)
    assert line.engine.in_step


def test_a_context_is_sent_again_after_everything_that_does_not_fit() -> None:
    line, chip = chip_line()
    line.ask(on_axis(GET_KP, 2))
    # set_kp with its command byte lost: its data is taken for set_1 and something illegal.
    line.device = spoiled(line.device, [(0, b"\x01\x00", None)])
    line.ask(on_axis(mc1231a.SetKpRequest(value=0x100), 2))
    assert chip.chip.axes[2].values["kp"] == 0x100
    assert chip.chip.axes[1].values["kp"] == 0


def test_more_than_the_answer_to_a_context() -> None:
    """Before an action nothing may be unexplained: the device may have taken something for a packet."""
    line, _ = chip_line()
    line.device = spoiled(line.device, [(0, None, bytes.fromhex("0300 0302 00"))])
    line.ask(on_axis(UPDATE, 2))
    assert line.sent == [b"\x02", b"\0", b"\x02", b"\x31", b"\x1a"]


def test_a_context_that_fails_is_tried_again_before_an_action() -> None:
    line, chip = chip_line()
    line.device = spoiled(line.device, [(0, None, b"")])
    assert line.ask(on_axis(UPDATE, 2)).attempts == 1
    assert chip.record is not None
    assert chip.record.count(b"\x1a") == 1


def test_nothing_was_sent_where_host_and_device_never_get_in_step() -> None:
    line = Line(make(), lambda _data, _now: [])
    error = line.fails(on_axis(UPDATE, 2))
    assert (type(error), error.attempts) == (NoReply, 0)
    assert "; not sent, " in str(error)
    assert b"\x1a" not in line.sent


def test_a_context_that_the_device_does_not_know() -> None:
    line = Line(make(), chip_device(ChipEngine(ChipSet(illegal=["set_2"]))))
    error = line.fails(on_axis(GET_KP, 2))
    assert type(error) is IllegalCommand
    assert line.ask(on_axis(GET_KP, 1)).attempts == 1


def test_a_line_that_does_not_get_quiet() -> None:
    def chatter(_data: bytes, now: float) -> list[tuple[float, bytes]]:
        return [(now + 0.0005 * step, b"\x55") for step in range(1, 2000)]

    line = Line(make(), chatter)
    error = line.fails(GET_KP)
    assert type(error) is BadReply
    assert "line never became idle" in str(error)


def test_a_caller_that_is_late_reads_old_bytes_and_listens_on() -> None:
    engine = make()
    quiet = engine.timing.quiet
    engine.receive(b"!", 0.0)
    engine.start(GET_KP, 0.0)
    engine.receive(b"?", 10.0)
    engine.handle_timer(10.0)
    assert engine.next_timer() == pytest.approx(10.0 + quiet)
    assert engine.bytes_to_send(10.0 + quiet)


@pytest.mark.parametrize("stage", range(6))
def test_a_transaction_that_is_given_up(stage: int) -> None:
    """At any stage: the answer of what was sent answers nothing later."""
    line, chip = chip_line()
    engine = line.engine
    engine.receive(b"!", 0.0)  # out of step, so that all stages are passed
    chip.chip.axes[2].write("kp", 9)
    engine.start(on_axis(mc1231a.GetTimeRequest(), 2), line.now)
    for _ in range(stage):
        if frame := engine.bytes_to_send(line.now):
            line.coming += line.device(frame, line.now)
        timer = engine.next_timer()
        if timer is not None:
            line._wait(timer)
    engine.abort(line.now)
    engine.abort(line.now)
    assert not engine.busy
    assert line.ask(on_axis(GET_KP, 2)).response.value == 9


def test_after_giving_up_the_answer_gets_its_time_and_then_the_line_is_quiet() -> None:
    engine = make()
    engine.start(mc1231a.SetPosRequest(value=1), 0.0)
    engine.bytes_to_send(0.0)
    deadline = engine.next_timer()
    assert deadline
    engine.abort(0.0)
    engine.start(GET_KP, 0.0)
    assert engine.next_timer() == pytest.approx(deadline + engine.timing.quiet)


# Unread checksums


def test_unread_answers_are_skipped_by_their_size() -> None:
    line, _ = chip_line(checked=())
    for value in range(20):
        line.ask(on_axis(mc1231a.SetKpRequest(value=value), 1 + value % 2))
    assert line.ask(on_axis(GET_KP, 1)).response.value == 18
    assert line.ask(on_axis(GET_KP, 2)).response.value == 19
    assert line.engine.total.out_of_step == 0
    assert line.ask(Packet(mc1231a.GetKdRequest(), SELECT[1], check=True)).response.value == 0


def test_unread_answers_that_do_not_come_are_noticed_when_there_is_time() -> None:
    line, _ = chip_line(checked=())
    line.device = spoiled(line.device, [(1, b"\x25\0", None)])
    line.ask(on_axis(mc1231a.SetKpRequest(value=1)))
    line.ask(on_axis(mc1231a.SetKdRequest(value=2)))
    line.now += 1.0
    line.ask(on_axis(mc1231a.SetKpRequest(value=1)))
    line.ask(on_axis(mc1231a.SetKdRequest(value=2)))
    assert line.engine.total.out_of_step == 1
    assert line.engine.in_step
    assert line.ask(on_axis(mc1231a.GetKpRequest())).response.value == 1


# Time


def test_a_call_ends_in_time_whatever_comes() -> None:
    """The worst case holds for a device that sends anything at any time, or nothing."""
    chance = random.Random(5)
    for _ in range(300):
        rate = chance.choice((0.0, 0.5, 1.0, 3.0))

        def anything(_data: bytes, now: float, rate: float = rate) -> list[tuple[float, bytes]]:
            count = int(rate + chance.random())
            return [
                (now + chance.random() * 0.01, chance.randbytes(chance.randint(1, 6))) for _ in range(count)
            ]

        attempts = chance.randint(1, 4)
        line = Line(make(attempts=attempts), anything)
        for request in (GET_KP, UPDATE, mc1231a.SetPosRequest(value=-1), GET_KP):
            begin = line.now
            with contextlib.suppress(LinkError):
                line.ask(on_axis(request, chance.randint(1, 2)))
            command = next(each for each in COMMANDS.values() if each.request is type(request))
            assert line.now - begin <= line.engine.timing.worst_case(command)


def test_the_terms_of_the_timing() -> None:
    timing = HostTiming.for_host(mc1231a, baud=BAUD, host_slack=SLACK, paced=True, attempts=3, forgets=0.01)
    assert timing.quiet == pytest.approx(0.01 + SLACK)
    assert timing.deadline(mc1231a.COMMANDS["set_pos"]) == pytest.approx(7 * BYTE + SLACK)
    assert timing.attempts_of(mc1231a.COMMANDS["update"]) == 1
    assert [timing.quiet_after(silent) / timing.quiet for silent in range(3)] == [1, 4, 16]
    for wrong in (-1.0, float("inf"), float("nan")):
        with pytest.raises(ValueError, match="forgets"):
            HostTiming.for_host(mc1231a, baud=BAUD, host_slack=0, paced=True, attempts=3, forgets=wrong)


def test_failures_are_events_too() -> None:
    line = Line(make(), lambda _data, _now: [])
    error = line.fails(GET_KP)
    kinds = {type(event) for event in line.engine.events}
    assert {Sent, TimedOut, OutOfStep, Filled, Failed} == kinds
    (failed,) = (event for event in line.engine.events if isinstance(event, Failed))
    assert failed.error is error
    assert line.engine.total.failures == 1
    assert "HostCounters(" in repr(line.engine.total)
