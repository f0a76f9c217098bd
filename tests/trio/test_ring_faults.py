"""Faults on the hops of a ring, and nodes that are switched off."""

from __future__ import annotations

import pytest

from qlinkgen.bus.ring_status import engine_of
from qlinkgen.codecs import trio
from qlinkgen.link.ring_events import Broken, NetStat
from qlinkgen.protocols.trio import CoordinatorNode, MotionCoordinator
from qlinkgen.sim import FaultPlan, SimulationError
from qlinkgen.sim.ring import RingWire
from qlinkgen.sim.virtual_ring import VirtualRing
from tests.soak.ring import FAULTS, Soak


def ring_of(size: int, **options: object) -> tuple[VirtualRing, list[MotionCoordinator]]:
    ring = VirtualRing(["coordinator"] * size, **options)  # type: ignore[arg-type]
    return ring, [ring.coordinator(place) for place in range(size)]


def send_all_round(ring: VirtualRing, clients: list[MotionCoordinator], count: int) -> None:
    """From the first node to the last, over every hop except one, one message at a time."""
    for number in range(count):
        clients[0].send(10 + len(clients) - 2, 1, number % 251, number + 1)
        ring.settle()


@pytest.mark.parametrize("baud", [None, 38400])
def test_a_message_that_is_dropped_leaves_no_trace_at_the_nodes(baud: int | None) -> None:
    plan = FaultPlan(drop=1.0)
    ring, clients = ring_of(4, baud=baud, faults={1: plan})
    send_all_round(ring, clients, 5)
    assert plan.counts["drop"] == 5
    assert clients[1].counters.passed == 5
    assert clients[3].counters.taken == 0
    assert all(client.netstat == 0 for client in clients)


@pytest.mark.parametrize("baud", [None, 38400])
def test_a_changed_bit_of_a_value_is_a_crc_error_at_the_receiver_alone(baud: int | None) -> None:
    plan = FaultPlan(flip=(1.0, 1, 1), seed=4)
    ring, clients = ring_of(4, baud=baud, faults={1: plan})
    send_all_round(ring, clients, 200)
    seen = [client.counters.faults for client in clients]
    assert not any(clients[3].vr[number] for number in range(251))
    assert seen[3]["crc"] > 100
    assert "crc" not in {**seen[0], **seen[1], **seen[2]}
    assert clients[3].netstat & NetStat.RX_CRC
    assert not clients[2].netstat & NetStat.RX_CRC


@pytest.mark.parametrize("baud", [None, 38400])
def test_a_truncated_message_is_seen_by_each_node_behind(baud: int | None) -> None:
    plan = FaultPlan(truncate=1.0, seed=2)
    ring, clients = ring_of(4, baud=baud, faults={0: plan})
    send_all_round(ring, clients, 50)
    assert clients[3].counters.taken == 0
    assert clients[1].netstat == clients[2].netstat == clients[3].netstat == NetStat.RX_FRAME
    # A missing head is detected at once. A missing tail is detected after the head was forwarded.
    cut = clients[1].counters.cut_short
    assert 30 <= cut <= 45
    assert clients[2].counters.total_faults == clients[3].counters.total_faults == cut
    told = [event for event in engine_of(ring.nodes[2]).events if isinstance(event, Broken)]
    # The end of a broken message may arrive before or after this node gives it up itself.
    assert {event.kind for event in told} <= {"frame", "truncated"}
    assert len(told) == cut


def test_store_and_forward_keeps_a_broken_message_from_the_nodes_behind() -> None:
    ring, clients = ring_of(4, faults={0: FaultPlan(truncate=1.0, seed=2)}, cut_through=False)
    send_all_round(ring, clients, 50)
    assert clients[1].netstat == NetStat.RX_FRAME
    assert clients[2].netstat == clients[3].netstat == 0


def test_noise_does_no_more_than_break_what_it_meets() -> None:
    # Noise must be rare: bytes forwarded because of it are disturbed in turn, so much of it would never end.
    plan = FaultPlan(noise=0.05, seed=3)
    ring, clients = ring_of(4, baud=38400, faults={0: plan})
    send_all_round(ring, clients, 250)
    wrong = [number for number in range(250) if clients[3].vr[number] not in {0, number + 1}]
    assert wrong == []
    assert clients[3].counters.taken >= 250 - plan.counts["noise"] > 200
    assert clients[1].netstat == NetStat.RX_FRAME


@pytest.mark.parametrize("kind", ["delay", "late", "silent", "duplicate", "stray"])
def test_the_other_kinds_of_faults(kind: str) -> None:
    plan = FaultPlan(**{kind: 0.5}, seed=1)  # type: ignore[arg-type]
    ring, clients = ring_of(3, baud=38400, faults={1: plan})
    send_all_round(ring, clients, 40)
    taken = clients[2].counters.taken
    assert plan.counts[kind] > 0
    expected = {
        "delay": 40,
        "late": 40,
        "silent": 40 - plan.counts.silenced,
        "duplicate": 40 + plan.counts["duplicate"],  # duplicates cannot be detected
        "stray": 40 + plan.counts["stray"],
    }
    assert taken == expected[kind]


def test_one_plan_serves_all_hops() -> None:
    plan = FaultPlan(drop=0.1, seed=1)
    ring, clients = ring_of(5, faults=plan)
    send_all_round(ring, clients, 100)
    assert clients[4].counters.taken == 100 - plan.counts["drop"]
    assert 20 < plan.counts["drop"] < 50


def test_a_hop_disturbs_whole_messages_and_what_stands_before_them() -> None:
    plan = FaultPlan(delay=1.0, keep_log=True)
    wire = RingWire(trio, faults=plan)
    wire.attach(CoordinatorNode().link)
    wire.transmit(b"\x99A", 0.0)
    wire.transmit(b"B\x91C\x90", 1.0)
    wire.advance(2.0)
    assert plan.log is not None
    sent = [each.data for each in plan.log]
    assert sent[:2] == [b"\x99AB", b"\x91C\x90"]
    assert wire.take(2.0)[-3:] == b"\x89C\x88"


def test_a_node_that_is_switched_off_opens_the_ring() -> None:
    ring, clients = ring_of(4)
    ring.switch_off(1)
    clients[0].send(12, 1, 1, 1)
    clients[2].send(10, 1, 2, 2)
    ring.settle()
    assert clients[3].vr[1] == 0
    assert clients[3].vr[2] == 2
    assert ring.wire.lost == 16
    clients[1].send(10, 1, 3, 3)
    ring.settle()
    assert clients[2].vr[3] == 0, "it does not send either"
    ring.switch_on(1)
    ring.settle()
    clients[0].send(12, 1, 1, 1)
    ring.settle()
    assert clients[3].vr[1] == 1
    assert clients[2].vr[3] == 0, "its queue is dropped"


def test_a_node_switched_off_in_the_middle_of_a_message_breaks_it() -> None:
    ring, clients = ring_of(4, baud=1000)
    clients[0].send(12, 1, 1, 1)
    ring.sleep(0.08)
    ring.switch_off(1)
    clients[2].send(10, 1, 2, 2)  # waits until the broken message is abandoned
    ring.settle()
    assert clients[3].vr[1] == 0
    assert clients[3].vr[2] == 2
    assert clients[2].counters.faults == {"truncated": 1}
    assert clients[3].counters.faults == {"frame": 1}
    assert clients[2].counters.cut_short == 1


def test_a_keypad_that_was_switched_off_needs_its_offset_again() -> None:
    ring = VirtualRing("coordinator,keypad")
    mc, keypad = ring.coordinator(0), ring.keypad(1)
    mc.send(10, 2, 10)
    mc.print_(10, "hello")
    ring.settle()
    assert keypad.lines[0] == "hello"
    ring.switch_off(1)
    ring.switch_on(1)
    mc.print_(10, "hello")
    ring.settle()
    assert keypad.lines[0] == ""
    assert keypad.node.counters.early_messages == 1
    assert not keypad.key_down(5)


def test_only_nodes_of_the_ring_can_be_switched() -> None:
    ring, _ = ring_of(2)
    other, _ = ring_of(1)
    with pytest.raises(SimulationError, match="not on this line"):
        ring.wire.switch_off(engine_of(other.nodes[0]))


# the soak run, shorter


@pytest.mark.parametrize("seed", [1, 2])
def test_every_message_of_a_soak_run_is_accounted_for(seed: int) -> None:
    account = Soak(seed).run(1500)
    assert account.clean, str(account)
    assert account.delivered > 1200
    assert account.seen["crc"] > 10
    assert all(account.injected[kind] for kind in ("drop", "flip", "truncate", "noise"))


def test_a_soak_run_on_a_line_that_takes_its_time() -> None:
    account = Soak(3, FAULTS, baud=38400).run(150)
    assert account.clean, str(account)


def test_without_faults_everything_is_delivered() -> None:
    account = Soak(1, "drop=0").run(1000)
    assert account.clean
    assert account.delivered == account.sent == 1000
    assert not account.seen
    assert not account.netstat


def test_the_same_seed_gives_the_same_account() -> None:
    assert str(Soak(5).run(300)) == str(Soak(5).run(300)) != str(Soak(6).run(300))


def test_the_account_finds_a_receiver_that_does_not_check(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trio, "_check", lambda *_: b"\0\0")  # independent of the payload
    account = Soak(1).run(1500)
    assert account.wrong > 0
    assert not account.clean
