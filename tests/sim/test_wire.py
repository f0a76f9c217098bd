"""The line without faults: reception and its times, collisions, echo, and errors."""

from __future__ import annotations

import math

import pytest

from qlinkgen.errors import QlinkgenError
from qlinkgen.sim import LINE, OUTSIDE, Echo, FaultPlan, FaultPlanError, SimulationError, Wire
from tests.sim.lines import ANSWER, REQUEST, Answerer, Talker, listen, sources

BAUD = 115200
BYTE = 10 / BAUD


def settle(wire: Wire, until: float = 1000.0) -> bytes:
    wire.advance(until)
    return wire.take(until)


def test_everybody_hears_the_others() -> None:
    wire = Wire(baud=None)
    stations = [Answerer(1), Answerer(2), Answerer(3)]
    names = [wire.attach(station) for station in stations]
    tap = listen(wire)
    wire.transmit(REQUEST, 5.0)
    assert wire.take(5.0) == ANSWER
    assert wire.take(5.0) == b""
    assert stations[0].heard == [(5.0, REQUEST)]  # not its own answer
    assert stations[1].heard == stations[2].heard == [(5.0, REQUEST), (5.0, ANSWER)]
    assert tap == [(5.0, OUTSIDE, REQUEST), (5.0, "station 1", ANSWER)]
    assert names == ["station 1", "station 2", "station 3"]


def test_a_station_may_hear_the_outside_alone() -> None:
    wire = Wire(baud=None, faults=FaultPlan(noise=1.0, to="slaves"))
    every, some = Talker(), Talker()
    wire.attach(Answerer())
    wire.attach(every)
    wire.attach(some, hears="outside")
    tap = listen(wire)
    wire.transmit(REQUEST, 0.0)
    wire.advance(1.0)
    assert b"".join(sources(tap, LINE))
    assert every.heard == [(at, data) for at, _, data in tap]
    assert some.heard == [(at, data) for at, source, data in tap if source in {OUTSIDE, LINE}]
    with pytest.raises(SimulationError, match="hears must be 'all' or 'outside', not 'nothing'"):
        wire.attach(Talker(), hears="nothing")  # type: ignore[arg-type]


def test_bytes_take_their_time() -> None:
    wire = Wire(baud=BAUD)
    station = Answerer(turnaround=0.001)
    wire.attach(station)
    wire.transmit(REQUEST, 0.0)
    asked = len(REQUEST) * BYTE
    assert wire.next_timer() == asked
    wire.advance(math.nextafter(asked, 0))
    assert station.heard == []
    wire.advance(asked)
    assert station.heard == [(asked, REQUEST)]
    assert wire.next_timer() == asked + 0.001
    wire.advance(asked + 0.001)
    answered = asked + 0.001 + len(ANSWER) * BYTE
    assert wire.next_timer() == answered
    assert wire.take(math.nextafter(answered, 0)) == b""
    assert wire.take(answered) == ANSWER
    assert wire.next_timer() is None


def test_bits_per_byte() -> None:
    wire = Wire(baud=9600, bits_per_byte=11)
    wire.transmit(b"12345", 2.0)
    assert wire.byte_time == 11 / 9600
    assert wire.next_timer() == 2.0 + 5 * (11 / 9600)


def test_one_sender_does_not_collide_with_itself() -> None:
    wire = Wire(baud=BAUD)
    station = Talker()
    wire.attach(station)
    for _ in range(3):
        wire.transmit(b"ab", 0.0)
    wire.advance(1.0)
    assert [data for _, data in station.heard] == [b"ab"] * 3
    assert [at for at, _ in station.heard] == [pytest.approx(n * 2 * BYTE) for n in (1, 2, 3)]
    assert wire.collisions == 0


def test_byte_by_byte() -> None:
    wire = Wire(baud=BAUD, chunks="byte")
    station = Answerer()
    wire.attach(station)
    tap = listen(wire)
    wire.transmit(REQUEST, 0.0)
    heard = settle(wire)
    assert heard == ANSWER
    assert station.heard == [(n * BYTE, REQUEST[n - 1 : n]) for n in range(1, len(REQUEST) + 1)]
    begin = len(REQUEST) * BYTE
    assert [row for row in tap if row[1] != OUTSIDE] == [
        (begin + n * BYTE, "station 1", ANSWER[n - 1 : n]) for n in range(1, len(ANSWER) + 1)
    ]


@pytest.mark.parametrize("baud", [None, BAUD])
def test_random_pieces_are_whole_in_the_end(baud: int | None) -> None:
    wire = Wire(baud=baud, chunks="random")
    station = Answerer()
    wire.attach(station)
    pieces = []
    for second in range(100):
        wire.transmit(REQUEST, float(second))
        wire.advance(second + 0.5)
        while piece := wire.take_piece(second + 0.5):
            pieces.append(piece)
    assert station.everything == REQUEST * 100
    assert b"".join(pieces) == ANSWER * 100
    assert {len(piece) for piece in pieces} >= set(range(1, len(ANSWER) + 1))


def test_pieces_of_one_instant_do_not_mix() -> None:
    wire = Wire(baud=None, chunks="byte")
    station = Talker()
    wire.attach(station)
    wire.transmit(b"abc", 0.0)
    wire.transmit(b"def", 0.0)
    wire.advance(0.0)
    assert b"".join(data for _, data in station.heard) == b"abcdef"


def test_what_two_send_at_once_is_garbled_where_they_overlap() -> None:
    wire = Wire(baud=BAUD)
    first, second, third = Talker((0.0, bytes(10))), Talker((6.5 * BYTE, bytes(10))), Talker()
    for station in (first, second, third):
        wire.attach(station)
    heard = settle(wire)
    early, late = heard[:10], heard[10:]
    # Bytes 6 to 9 of the first one collide with bytes 0 to 3 of the second, which ends at 16.5 byte times.
    assert early[:6] == bytes(6)
    assert all(early[6:])
    assert all(late[:4])
    assert late[4:] == bytes(6)
    assert [data for _, data in third.heard] == [early, late]
    assert [data for _, data in first.heard] == [late]
    assert wire.collisions == 1


def test_a_short_one_within_a_long_one() -> None:
    wire = Wire(baud=BAUD, chunks="byte")
    wire.attach(Talker((0.0, bytes(10))), "long")
    wire.attach(Talker((4 * BYTE, bytes(2))), "short")
    tap = listen(wire)
    wire.advance(1.0)
    long = b"".join(sources(tap, "long"))
    assert long[:4] + long[6:] == bytes(8)
    assert all(long[4:6])
    assert all(b"".join(sources(tap, "short")))


def test_three_at_once_count_each_that_comes_in_between() -> None:
    wire = Wire(baud=BAUD)
    for n in range(3):
        wire.attach(Talker((n * BYTE, bytes(10))))
    assert all(settle(wire)[2:10])
    assert wire.collisions == 2


def test_a_long_one_is_met_behind_a_short_one() -> None:
    wire = Wire(baud=BAUD)
    for begin, size in ((0, 20), (2, 2), (10, 3)):
        wire.attach(Talker((begin * BYTE, bytes(size))))
    heard = settle(wire)
    assert all(heard[:5])  # the two short ones
    long = heard[5:]
    assert [n for n in range(20) if long[n]] == [2, 3, 10, 11, 12]
    assert wire.collisions == 2


def test_no_garbled_byte_stays_what_it_was() -> None:
    wire = Wire(baud=BAUD)
    wire.attach(Talker((0.0, bytes(4000))))
    wire.attach(Talker((0.0, bytes(4000))))
    assert all(settle(wire))


def test_what_collides_for_hours_needs_no_more_memory() -> None:
    wire = Wire(baud=BAUD)
    for shift in (0, 3):
        wire.attach(Talker(*(((n * 7 + shift) * BYTE, bytes(7)) for n in range(2000))))
    assert len(settle(wire)) == 28_000
    assert wire.collisions > 2000
    assert len(wire._sending) < 5


def test_who_hears_and_sends_at_the_same_instant_hears_first() -> None:
    class Reflector(Talker):
        def bytes_to_send(self, now: float) -> bytes:
            self.sending.clear()
            return b"".join(data for _, data in self.heard)

    wire = Wire(baud=BAUD)
    wire.attach(Reflector((4 * BYTE, b"")))
    wire.transmit(b"abcd", 0.0)
    assert settle(wire) == b"abcd"


def test_back_to_back_is_no_collision() -> None:
    wire = Wire(baud=BAUD)
    for n in range(50):
        wire.attach(Talker((7 * n * BYTE, bytes(7))))
    assert settle(wire) == bytes(350)
    assert wire.collisions == 0


def test_the_outside_collides_as_well() -> None:
    wire = Wire(baud=BAUD)
    station = Answerer()
    wire.attach(station)
    wire.transmit(REQUEST, 0.0)
    begin = len(REQUEST) * BYTE
    wire.transmit(bytes(4), begin + 2 * BYTE)
    answer = settle(wire)
    assert answer[:2] + answer[6:] == ANSWER[:2] + ANSWER[6:]
    assert all(a != b for a, b in zip(answer[2:6], ANSWER[2:6], strict=True))
    assert all(station.heard[1][1])


def test_without_collisions_both_get_through() -> None:
    wire = Wire(baud=BAUD, collisions=False)
    wire.attach(Talker((0.0, b"aaaa")))
    wire.attach(Talker((BYTE, b"bbbb")))
    assert settle(wire) == b"aaaabbbb"
    assert wire.collisions == 0


def test_an_echo_takes_as_long_as_the_bytes() -> None:
    wire = Wire(baud=BAUD, echo=True, chunks="byte")
    tap = listen(wire)
    wire.transmit(b"abcd", 0.0)
    for n in range(1, 5):
        at = 0.0 + n * BYTE
        assert wire.take(math.nextafter(at, 0)) == b""
        assert wire.take(at) == b"abcd"[n - 1 : n]
    assert b"".join(sources(tap, OUTSIDE)) == b"abcd"  # on the line once


def test_an_echo_comes_before_the_answer() -> None:
    for baud in (None, BAUD):
        wire = Wire(baud=baud, echo=True)
        wire.attach(Answerer())
        wire.transmit(REQUEST, 0.0)
        assert settle(wire) == REQUEST + ANSWER


def test_an_echo_shows_a_collision() -> None:
    wire = Wire(baud=BAUD, echo=True)
    wire.attach(Talker((0.0, bytes(3))))
    wire.transmit(bytes(5), 2 * BYTE)
    heard = settle(wire)
    assert heard[:2] == bytes(2)
    assert heard[2]
    assert heard[3]
    assert heard[4:] == bytes(4)
    assert wire.collisions == 1


def test_an_echo_of_what_never_left_disturbs_nobody() -> None:
    wire = Wire(baud=BAUD, echo=True, faults=FaultPlan(drop=1.0, to="slaves"))
    wire.attach(Talker((0.0, bytes(8))))
    wire.transmit(bytes(5), 2 * BYTE)
    tap = listen(wire)
    heard = settle(wire)
    assert all(heard[:5])  # the echo shows the traffic on the line
    assert heard[5:] == bytes(8)
    assert sources(tap, "station 1") == [bytes(8)]
    assert wire.collisions == 0


def test_a_flawed_echo_leaves_the_line_alone() -> None:
    echo = Echo(partial=0.3, changed=0.3, seed=4)
    wire = Wire(baud=None, echo=echo)
    station = Talker()
    wire.attach(station)
    found = {"whole": 0, "partial": 0, "changed": 0}
    for second in range(2000):
        wire.transmit(bytes(12), float(second))
        heard = wire.take(float(second))
        assert 1 <= len(heard) <= 12
        found["partial"] += len(heard) < 12
        found["changed"] += any(heard)
        found["whole"] += heard == bytes(12)
    assert {data for _, data in station.heard} == {bytes(12)}
    assert found == echo.counts
    assert min(found.values()) > 400


def test_a_partial_echo_misses_a_head_or_a_tail() -> None:
    wire = Wire(baud=None, echo=Echo(partial=1.0))
    sent = bytes(range(12))
    heads = tails = 0
    for second in range(200):
        wire.transmit(sent, float(second))
        heard = wire.take(float(second))
        heads += sent.endswith(heard)
        tails += sent.startswith(heard)
    assert heads + tails == 200
    assert heads > 50
    assert tails > 50


def test_an_echo_of_one_byte_is_there_or_not_partial() -> None:
    echo = Echo(partial=1.0)
    wire = Wire(baud=None, echo=echo)
    wire.transmit(b"x", 0.0)
    assert wire.take(0.0) == b"x"
    assert echo.counts == {"whole": 1, "partial": 0, "changed": 0}


def test_a_head_missing_of_an_echo_takes_its_time() -> None:
    wire = Wire(baud=BAUD, echo=Echo(partial=1.0))
    for second in range(20):
        wire.transmit(bytes(range(8)), float(second))
        at = wire.run(second + 0.5)
        assert at is not None
        heard = wire.take(at)
        assert at == pytest.approx(second + (heard[-1] + 1) * BYTE, abs=1e-9)


@pytest.mark.parametrize("flaw", [{"partial": 1.5}, {"changed": -0.1}, {"partial": math.nan}])
def test_an_echo_needs_chances(flaw: dict[str, float]) -> None:
    with pytest.raises(FaultPlanError, match="from 0 to 1"):
        Echo(**flaw)  # type: ignore[arg-type]


def test_detached_stations_are_silent_and_deaf() -> None:
    wire = Wire(baud=BAUD)
    station, other = Answerer(turnaround=0.001), Talker()
    wire.attach(station)
    wire.attach(other)
    wire.transmit(REQUEST, 0.0)
    wire.detach(station)  # while the request is in transit
    wire.advance(1.0)
    assert station.heard == []
    wire.attach(station)
    wire.transmit(REQUEST, 1.0)
    wire.advance(1.0 + len(REQUEST) * BYTE)
    assert station.requests == 1
    wire.detach(station)  # before its answer
    assert settle(wire) == b""
    with pytest.raises(SimulationError, match="attach it first"):
        wire.detach(station)


def test_a_station_changed_by_others_is_woken() -> None:
    wire = Wire(baud=None)
    station = Talker()
    wire.attach(station)
    station.sending.append((2.0, b"now"))
    assert wire.next_timer() is None
    wire.wake(station)
    assert wire.next_timer() == 2.0
    assert wire.take(2.0) == b"now"
    with pytest.raises(SimulationError, match="attach it first"):
        wire.wake(Talker())


def test_a_timer_that_changes_its_mind() -> None:
    wire = Wire(baud=None)
    station = Talker((5.0, b"later"))
    wire.attach(station)
    station.sending[0] = (3.0, b"sooner")
    wire.wake(station)
    assert wire.next_timer() == 3.0
    station.sending.clear()
    wire.wake(station)
    assert wire.next_timer() is None
    station.sending.append((math.inf, b"never"))
    wire.wake(station)
    assert wire.next_timer() is None


def test_a_time_gone_by_means_now() -> None:
    wire = Wire(baud=BAUD)
    wire.advance(10.0)
    wire.attach(Talker((3.0, b"x")))
    assert wire.run(20.0) == 10.0 + BYTE


def test_names_are_of_one_station_each() -> None:
    wire = Wire(baud=None)
    assert wire.attach(Talker(), "node 3") == "node 3"
    for name in ("node 3", OUTSIDE, LINE):
        with pytest.raises(SimulationError, match="names must be unique"):
            wire.attach(Talker(), name)


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"baud": 0}, "baud must be above 0, .* not 0"),
        ({"baud": -9600}, "baud must be above 0, .* not -9600"),
        ({"baud": 9600, "bits_per_byte": 0}, "bits_per_byte must be above 0, .* not 0"),
        ({"baud": None, "chunks": "half"}, "chunks must be .* not 'half'"),
    ],
)
def test_wrong_arguments(given: dict[str, object], text: str) -> None:
    with pytest.raises(SimulationError, match=text):
        Wire(**given)  # type: ignore[arg-type]


@pytest.mark.parametrize("now", [4.0, math.nan, math.inf, -math.inf])
def test_time_moves_on(now: float) -> None:
    wire = Wire(baud=None)
    assert wire.run(5.0) is None
    for call in (wire.advance, wire.take, wire.take_piece, lambda at: wire.transmit(b"x", at)):
        with pytest.raises(SimulationError, match="now must be finite"):
            call(now)
    assert issubclass(SimulationError, QlinkgenError)


def test_a_station_that_never_gets_done() -> None:
    class Stuck(Talker):
        def next_timer(self) -> float | None:
            return 1.0

    wire = Wire(baud=None)
    wire.attach(Stuck(), "stuck one")
    with pytest.raises(SimulationError, match=r"events at 1\.0 s, the last at 'stuck one'"):
        wire.advance(2.0)


def test_stations_that_answer_one_another_without_end() -> None:
    wire = Wire(baud=None)
    wire.attach(Answerer(1, answer=b"\x02request"))
    wire.attach(Answerer(2, answer=b"\x01request"))
    wire.transmit(REQUEST, 0.0)
    with pytest.raises(SimulationError, match="need a baud or a turnaround"):
        wire.advance(1.0)


def test_nothing_is_not_sent() -> None:
    wire = Wire(baud=BAUD, echo=True)
    tap = listen(wire)
    wire.transmit(b"", 0.0)
    assert wire.next_timer() is None
    assert tap == []


def test_a_buffer_may_be_used_again() -> None:
    wire = Wire(baud=BAUD)
    station = Talker()
    wire.attach(station)
    buffer = bytearray(b"abc")
    wire.transmit(buffer, 0.0)  # type: ignore[arg-type]
    buffer[:] = b"xyz"
    wire.advance(1.0)
    assert station.heard == [(3 * BYTE, b"abc")]
