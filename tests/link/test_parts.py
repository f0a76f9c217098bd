"""The parts of the engines alone: tables of states, attempts, the wait for silence, pending requests."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Any

import pytest

from qlinkgen.codecs import mc1231a, qlink
from qlinkgen.link import Timing
from qlinkgen.link.attempts import Attempts
from qlinkgen.link.counters import LinkCounters
from qlinkgen.link.echo import PROBE, EchoProbe
from qlinkgen.link.host_parts import Awaited, Unread, WayBack
from qlinkgen.link.host_rules import Asked, CommandRules, HostRules
from qlinkgen.link.host_states import HOST_MOVES, HostEvent, HostState
from qlinkgen.link.host_timing import ROUNDS, SILENT_ROUNDS, HostTiming
from qlinkgen.link.master_states import MASTER_MOVES, MasterEvent, MasterState
from qlinkgen.link.pending import Pending
from qlinkgen.link.quiet import QuietLine, Silence
from qlinkgen.link.state import Moves
from qlinkgen.link.transaction import CommandTiming
from qlinkgen.protocols.mc1231a.facts import RULES


class TestTables:
    @pytest.mark.parametrize(
        ("moves", "states", "events"),
        [(MASTER_MOVES, MasterState, MasterEvent), (HOST_MOVES, HostState, HostEvent)],
        ids=["master", "host"],
    )
    def test_every_state_and_event_is_in_use(
        self, moves: Mapping[Any, StrEnum], states: type[StrEnum], events: type[StrEnum]
    ) -> None:
        assert {state for state, _ in moves} == set(moves.values()) == set(states)
        assert {event for _, event in moves} == set(events)

    @pytest.mark.parametrize("moves", [MASTER_MOVES, HOST_MOVES], ids=["master", "host"])
    def test_every_busy_state_can_be_aborted(self, moves: Mapping[Any, StrEnum]) -> None:
        table = {(str(state), str(event)): str(after) for (state, event), after in moves.items()}
        busy = {state for state, _ in table} - {"idle"}
        assert {table[state, "abort"] for state in busy} == {"idle"}
        assert ("idle", "abort") not in table

    def test_the_table_is_what_is_looked_up(self) -> None:
        sent = Moves(MASTER_MOVES, MasterEvent.SENT)
        assert sent[MasterState.GUARD] is MasterState.WAITING

    def test_an_event_that_the_table_does_not_have(self) -> None:
        with pytest.raises(RuntimeError, match=r"SENT.*cannot happen in state.*IDLE"):
            Moves(MASTER_MOVES, MasterEvent.SENT)[MasterState.IDLE]


class TestAttempts:
    def test_count_down(self) -> None:
        attempts = Attempts()
        attempts.begin(2, 1.0)
        assert attempts.left
        attempts.number = 2
        assert not attempts.left

    def test_the_reply_has_both_times(self) -> None:
        attempts = Attempts()
        attempts.begin(3, 1.0)
        attempts.number, attempts.sent_at = 2, 1.5
        reply = attempts.reply(None, 2.25)
        assert (reply.attempts, reply.elapsed, reply.at, reply.response_time) == (2, 1.25, 2.25, 0.75)

    def test_wrong_replies_are_of_one_transaction(self) -> None:
        attempts = Attempts()
        attempts.begin(1, 0.0)
        attempts.wrong += [("frame", b"a"), ("crc", b"b"), ("crc", b"c")]
        assert attempts.wrong_kinds() == ["crc", "frame"]
        assert attempts.wrong_bytes() == b"abc"
        attempts.begin(1, 1.0)
        assert attempts.wrong_kinds() == []


class TestSilence:
    def test_bytes_restart_it_but_not_its_limit(self) -> None:
        line = Silence(quiet=1.0, limit=5.0)
        line.quiet_at, line.give_up_at = 1.0, 5.0
        line.disturbed(0.5)
        assert (line.quiet_at, line.give_up_at, line.due()) == (1.5, 5.0, 1.5)
        for tenth in range(5, 50, 5):
            line.disturbed(tenth / 10)
        assert (line.due(), line.failed(4.9), line.failed(5.0)) == (5.0, False, True)

    def test_a_late_caller_gets_the_whole_limit(self) -> None:
        line = Silence(quiet=1.0, limit=5.0)
        line.quiet_at, line.give_up_at = 1.0, 5.0
        line.disturbed(9.0)
        assert (line.quiet_at, line.give_up_at) == (10.0, 14.0)

    def test_nobody_waits(self) -> None:
        line = Silence(quiet=1.0, limit=5.0)
        line.disturbed(9.0, waiting=False)
        assert (line.quiet_at, line.give_up_at) == (10.0, 0.0)

    def test_a_trusted_line_is_ready_when_it_is_free(self) -> None:
        line = QuietLine(quiet=1.0, limit=5.0)
        line.free_at = 2.0
        assert (line.due(), line.ready(1.9), line.ready(2.0), line.failed(100.0)) == (2.0, False, True, False)

    def test_a_suspect_line_has_to_be_quiet(self) -> None:
        line = QuietLine(quiet=1.0, limit=5.0)
        line.distrust(2.0)
        assert (line.due(), line.ready(2.9), line.ready(3.0)) == (3.0, False, True)
        line.free_at = 4.0
        line.await_quiet(2.5)
        assert (line.due(), line.ready(3.5), line.give_up_at) == (4.0, False, 9.0)


class TestProbe:
    @pytest.mark.parametrize("heard", [PROBE, PROBE[:1], b"\xff" + PROBE, b"\xff\xff" + PROBE])
    def test_echoed(self, heard: bytes) -> None:
        probe = EchoProbe()
        assert probe.send(1.0) == PROBE
        assert probe.echoed(heard)
        assert probe.until == 1.0

    def test_in_pieces_and_not_from_an_earlier_probe(self) -> None:
        probe = EchoProbe()
        probe.send(1.0)
        assert not probe.echoed(b"\xff")
        assert probe.echoed(PROBE)
        probe.send(2.0)
        assert not probe.echoed(b"\xff\xff\xff" + PROBE)


def pending(request: Any) -> Pending:
    timing = Timing.of(qlink, host_slack=0.002)
    command = next(each for each in qlink.COMMANDS.values() if each.request is type(request))
    to_all = request.node == qlink.BUS.broadcast
    timed = CommandTiming(command, timing, None)
    return Pending(request, timed, request.node, request.to_frame(), LinkCounters(), to_all)


class TestPending:
    def test_class_node_and_echoed_fields_are_compared(self) -> None:
        asked = pending(qlink.LoopBackRequest(node=3, data=b"ab"))
        response = qlink.LoopBackResponse(node=3, data=b"ab")
        assert asked.answered_by(response, 3)
        assert not asked.answered_by(response, 4)
        other = qlink.LoopBackResponse(node=3, offset=1, data=b"ab")
        assert not asked.answered_by(other, 3)
        assert asked.may_be_answered_by(other, 3)
        assert not asked.may_be_answered_by(other, 4)
        assert not asked.may_be_answered_by(qlink.NodeResetResponse(node=3), 3)

    def test_a_broadcast_is_answered_if_the_command_says_so(self) -> None:
        assert pending(qlink.NodeResetRequest(node=3)).is_answered
        broadcasts = [each.request for each in qlink.COMMANDS.values() if each.addressing == "broadcast"]
        assert not pending(broadcasts[0](node=0)).is_answered


def host_asked(request: Any, rules: HostRules = RULES) -> Asked:
    timing = HostTiming.for_host(mc1231a, baud=115200, host_slack=0.002, paced=True, attempts=3, forgets=0.0)
    command = next(each for each in mc1231a.COMMANDS.values() if each.request is type(request))
    return Asked(request, CommandRules(command, timing, rules, check=True), request.to_frame())


class TestHost:
    def test_the_awaited_answer_ends_with_its_checksum_if_that_is_read(self) -> None:
        asked = host_asked(mc1231a.GetKpRequest())
        awaited = Awaited(asked)
        awaited.ask(asked, 1.0, check=True)
        assert (awaited.need, awaited.late(0.9), awaited.late(1.0)) == (4, False, True)
        awaited.ask(asked, 1.0, check=False)
        assert awaited.need == 2
        awaited.stop()
        assert not awaited.late(1.0)

    def test_unread_answers_delay_the_next_one_and_are_discarded(self) -> None:
        asked, unread = host_asked(mc1231a.GetKpRequest()), Unread(0.001)
        first = unread.line_up(asked, 0.0)
        unread.owe(4, first)
        assert unread.line_up(asked, 0.0) == pytest.approx(first + 0.001 + 4 * 0.001)
        assert not unread.overdue(first)
        assert unread.overdue(first + 0.001)
        assert (unread.discard(b"abc"), unread.owed) == (b"", 1)
        assert (unread.discard(b"def"), unread.owed) == (b"ef", 0)
        assert not unread.overdue(first + 1)

    def test_silent_rounds_are_fewer(self) -> None:
        for heard, rounds in ((True, ROUNDS), (False, SILENT_ROUNDS)):
            way = WayBack(RULES)
            way.heard = heard
            lost = 1
            while way.lose_round():
                lost += 1
            assert lost == rounds
            way.begin()
            assert way.lose_round()

    def test_the_fill_byte_depends_on_what_was_pending(self) -> None:
        rules = HostRules(mc1231a.GetKpRequest(), fill=7, fills={mc1231a.SetKpRequest: 9})
        way = WayBack(rules)
        way.choose_fill(mc1231a.SetKpRequest)
        assert (way.next_fill(), way.fills) == (b"\x09", 1)
        way.choose_fill(None)
        assert (way.next_fill(), way.fills) == (b"\x07", 2)
        way.begin_round()
        assert way.fills == 0

    @pytest.mark.parametrize(("answer", "completed"), [(b"", False), (RULES.refusal, False), (b"\1\2", True)])
    def test_an_answer_to_a_fill_byte_is_that_of_a_packet(self, answer: bytes, completed: bool) -> None:
        way = WayBack(RULES)
        way.filled(answer)
        assert way.completed is completed
