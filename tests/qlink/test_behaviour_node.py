"""Everything except motion: sections 7.1 to 7.9 and 7.14 to 7.19, settled questions 5, 6 and 11 to 14."""

from __future__ import annotations

from binascii import crc_hqx
from itertools import count, pairwise
from pathlib import Path

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.codecs.qlink import PositionType
from qlinkgen.errors import LinkError, LoadError, NoReply
from qlinkgen.link import HealthPolicy
from qlinkgen.protocols.qlink import Found, LoadProgress
from tests.firmware.node import backwards
from tests.qlink.behaviour_rig import Rig, Slave
from tests.qlink.conftest import MakeRig


def hex_text(records: int) -> bytes:
    """An Intel HEX text with 16 bytes in each record."""
    lines = []
    for index in range(records):
        record = bytes(
            (16, *(16 * index).to_bytes(2, "big"), 0, *((index * 7 + at) & 0xFF for at in range(16)))
        )
        lines.append(b":%s%02X\r\n" % (record.hex().upper().encode(), -sum(record) & 0xFF))
    return b"".join([*lines, b":00000001FF\r\n"])


class TestLoad:
    def test_a_program_of_more_than_256_pieces_arrives_as_it_is(self, make: MakeRig) -> None:
        rig = make()
        text = hex_text(30)
        told: list[LoadProgress] = []
        report = rig.bus.load(1, text, piece=5, patience=60.0, progress=told.append)
        assert report.pieces == -(-len(text) // 5) > 256
        assert rig.node.loaded == text
        assert rig.node.stored == 480
        assert rig.node.memory(480) == bytes(((at >> 4) * 7 + (at & 15)) & 0xFF for at in range(480))
        assert rig.node.statistics.program_pieces == report.pieces
        assert [each.acknowledged for each in told] == [*range(0, len(text), 5), len(text)]
        heard = [each for each in rig.node.heard if isinstance(each, qlink.NodeProgramLoadRequest)]
        assert (heard[0].counter, heard[0].program_data) == (0, b"")
        numbers = [each.counter for each in heard if each.program_data]
        fresh = numbers[:1] + [after for before, after in pairwise(numbers) if after != before]
        assert fresh == [index % 256 for index in range(report.pieces)]

    def test_a_file_is_read_and_loaded(self, make_clean: MakeRig, tmp_path: Path) -> None:
        rig = make_clean()
        file = tmp_path / "program.hex"
        file.write_bytes(hex_text(3))
        rig.bus.node(1).load(file)
        assert rig.node.loaded == hex_text(3)

    def test_it_goes_on_after_lost_answers_and_stores_nothing_twice(self, make: MakeRig) -> None:
        rig = make()
        text = hex_text(6)
        lose = iter([3, 1, 4])

        def lose_some(progress: LoadProgress) -> None:
            rig.node.mute = next(lose, 0) if progress.acknowledged else 0

        report = rig.bus.load(1, text, patience=60.0, progress=lose_some)
        assert rig.node.loaded == text
        assert rig.node.statistics.repeated_pieces >= (1 if rig.faulty else 8)
        assert report.repeats >= (1 if rig.faulty else 8)

    def test_a_node_that_goes_away_is_a_clean_error(self, make_clean: MakeRig) -> None:
        rig = make_clean()

        def go_away(progress: LoadProgress) -> None:
            rig.node.deaf = 1000 if progress.acknowledged == 50 else 0

        with pytest.raises(LoadError) as caught:
            rig.bus.load(1, hex_text(4), patience=0.0, progress=go_away)
        assert (caught.value.acknowledged, caught.value.total) == (50, len(hex_text(4)))
        rig.node.deaf = 0
        rig.bus.load(1, hex_text(4))
        assert rig.node.loaded == hex_text(4)

    def test_an_opening_without_any_data_is_one_too(self, make_clean: MakeRig) -> None:
        rig = make_clean()
        body = bytes((4, 0x06, 1))  # neither counter nor data, which no encoder makes
        frame = b"\xa5\xa5" + body + crc_hqx(body, 0xFFFF).to_bytes(2, "big")
        rig.bus.port.write(frame)
        rig.sleep(0.05)
        rig.bus.node_info(1)
        assert rig.node.statistics.program_loads == 1


class TestSync:
    def test_a_node_counts_the_syncs_that_it_has_missed(self, make: MakeRig) -> None:
        rig = make()
        for counter in (None, None, 250, None, 3):
            rig.bus.node_sync(counter=counter)
        rig.sure(lambda: rig.bus.node_info(1))
        counts = rig.node.statistics
        heard = [each.counter for each in rig.node.heard if isinstance(each, qlink.NodeSyncRequest)]
        assert counts.syncs == len(heard)
        assert counts.missed_syncs == sum(
            (after - before - 1) % 256 for before, after in pairwise(heard) if after != before
        )
        if not rig.faulty:
            assert heard == [0, 1, 250, 251, 3]
            assert counts.missed_syncs == 248 + 7

    def test_syncs_at_an_interval_reach_every_node(self, make_clean: MakeRig) -> None:
        rig = make_clean(Slave(1), Slave(2))
        report = rig.bus.sync(0.01, count=20)
        rig.bus.node_info(1)
        assert report.sent == 20
        for node in rig.nodes:
            assert [each.counter for each in node.heard if isinstance(each, qlink.NodeSyncRequest)] == list(
                range(20)
            )
            assert node.statistics.missed_syncs == 0
        if rig.paced:
            assert report.missed == 0
            assert report.jitter < 0.001


class TestMotor:
    def test_a_request_is_polled_until_it_is_completed(self, make: MakeRig) -> None:
        # Long enough for the first poll to be too early on a busy machine.
        rig = make(Slave(motor=backwards, motor_seconds=0.5))
        answer = rig.sure(lambda: rig.bus.complete_motor_request(1, b"\xa5\xa5\x00ask"))
        assert (answer.last_completion, bytes(answer.motor_data)) == (0x16, b"ksa\x00\xa5\xa5")
        polls = [each for each in rig.node.heard if isinstance(each, qlink.MotorResponsePollRequest)]
        assert len(polls) >= 2
        if not rig.faulty:
            assert rig.node.statistics.motor_requests == 1

    def test_a_request_is_never_repeated(self, make_clean: MakeRig) -> None:
        rig = make_clean()
        rig.node.mute = 1
        with pytest.raises(NoReply) as caught:
            rig.bus.motor_request(1, motor_data=b"once")
        assert caught.value.attempts == 1
        rig.bus.node_info(1)
        assert rig.node.statistics.motor_requests == 1

    def test_one_that_is_never_completed_is_a_clean_error(self, make_clean: MakeRig) -> None:
        rig = make_clean(Slave(motor_seconds=60.0))
        with pytest.raises(NoReply, match="not completed"):
            rig.bus.complete_motor_request(1, b"ask", timeout=0.05)


class TestInputsAndOutputs:
    def test_output_1_follows_input_1_after_t1_and_t2(self, make: MakeRig) -> None:
        rig = make(Slave(t1_delay=9.9, t2_delay=9.9))
        rig.sure(lambda: rig.bus.node_setup(1, t1_delay=0.3, t2_delay=0.2))
        for level, delay in ((1, 0.3), (0, 0.2)):
            rig.sure(lambda: rig.bus.node_info(1))
            edge = rig.node.switch_input_1(level)
            assert rig.node.outputs == 1 - level
            rig.until(lambda level=level: rig.node.outputs == level)  # type: ignore[misc]
            assert rig.node.clock() - edge >= delay - 1e-6  # rounding of floats
            if rig.exact and not rig.faulty:
                assert rig.node.clock() - edge < delay + 0.05

    def test_reads_past_the_inputs_give_0_and_writes_past_the_outputs_nothing(self, make: MakeRig) -> None:
        rig = make()
        rig.node.inputs = 0xC0A5A4
        answers = {
            (size, offset): bytes(rig.sure(lambda s=size, o=offset: rig.bus.read(1, size=s, offset=o)).data)  # type: ignore[misc]
            for size, offset in ((3, 0), (26, 0), (2, 2), (1, 3), (26, 255))
        }
        assert answers == {
            (3, 0): b"\xa4\xa5\xc0",
            (26, 0): b"\xa4\xa5\xc0" + bytes(23),
            (2, 2): b"\xc0\0",
            (1, 3): b"\0",
            (26, 255): bytes(26),
        }
        rig.sure(lambda: rig.bus.write(1, data=b"\x01\x02\x03\x04\x05"))
        assert rig.node.outputs == 0x030201
        rig.sure(lambda: rig.bus.write(1, offset=2, data=b"\xa5\xff"))
        rig.sure(lambda: rig.bus.write(1, offset=200, data=b"\xff"))
        assert rig.node.outputs == 0xA50201

    def test_masks_and_images_of_24_bits(self, make: MakeRig) -> None:
        rig = make()
        rig.node.inputs = 0x8000A5 & ~1
        assert rig.sure(lambda: rig.bus.write_read(1, outputs=0xA5A500)).inputs == 0x8000A4
        assert rig.node.outputs == 0xA5A500
        rig.sure(lambda: rig.bus.set_outputs(1, mask=0x00000F))
        assert rig.node.outputs == 0xA5A50F
        rig.sure(lambda: rig.bus.clear_outputs(1, mask=0xA00001))
        assert rig.node.outputs == 0x05A50E

    def test_a_checksum_that_ends_in_a5(self, make: MakeRig) -> None:
        rig = make()
        asked = (bytes((value,)) for value in count())
        odd = [
            data
            for _, data in zip(range(256), asked, strict=False)
            if qlink.LoopBackRequest(node=1, data=data).to_frame().endswith(b"\xa5\0")
        ]
        assert odd
        for data in odd * 5:
            assert bytes(rig.sure(lambda data=data: rig.bus.loop_back(1, data=data)).data) == data  # type: ignore[misc]


class TestReset:
    def test_it_is_answered_and_clears_fifo_and_outputs(self, make: MakeRig) -> None:
        rig = make()
        rig.move(1, [1, 2, 3], outputs=0xFF)
        rig.sure(lambda: rig.bus.write(1, offset=1, data=b"\xff\xff"))
        assert rig.node.outputs == 0xFFFFFF
        rig.sure(lambda: rig.bus.node_reset(1))
        assert (rig.node.waiting, rig.node.outputs) == (0, 0)
        assert rig.move(1, [4]).fifo_space == rig.node.capacity - 1


class TestStart:
    def test_a_broadcast_starts_and_stops_all_nodes(self, make_clean: MakeRig) -> None:
        rig = make_clean(*(Slave(number) for number in (1, 7, 16)))
        for method, started in ((rig.bus.node_start, True), (rig.bus.node_stop, False)):
            method(0)
            rig.bus.node_info(16)
            assert [node.started for node in rig.nodes] == [started] * 3
        rig.bus.node_start(7)
        rig.bus.node_info(16)
        assert [node.started for node in rig.nodes] == [False, True, False]

    def test_a_stop_is_sent_also_to_a_node_that_is_offline(self, make_clean: MakeRig) -> None:
        rig = make_clean(health=HealthPolicy(offline_after=1, first_pause=1e3, longest_pause=1e3), attempts=1)
        rig.bus.node_start(1)
        rig.node.deaf = 2
        with pytest.raises(NoReply):
            rig.bus.node_info(1)
        with pytest.raises(NoReply, match="not sent"):
            rig.bus.node_info(1)
        rig.node.deaf = 0
        rig.bus.node_stop(1)
        rig.sleep(0.5)
        assert not rig.node.started


class TestUnsupported:
    def test_a_command_that_a_node_has_not_is_not_answered(self, make: MakeRig) -> None:
        rig = make(Slave(unsupported=("loop_back",)))
        with pytest.raises(LinkError) as caught:
            rig.bus.loop_back(1, data=b"x")
        if not rig.faulty:
            assert isinstance(caught.value, NoReply)
        assert rig.sure(lambda: rig.bus.node_info(1)).version_major == 1

    def test_nobody_answers_for_a_node_that_there_is_not(self, make: MakeRig) -> None:
        rig = make()
        # The answers of the last three are equal to the requests: an echo must not be taken for one.
        calls = (
            lambda: rig.bus.motor_position(9),
            lambda: rig.bus.clear_fifo(9),
            lambda: rig.bus.node_reset(9),
            lambda: rig.bus.loop_back(9, data=b"\xa5echo"),
        )
        for call in calls * (15 if rig.setting.echo != "none" else 1):
            with pytest.raises(LinkError):
                call()


def set_up_as_9(rig: Rig) -> int:
    """Set another number and other settings of node 3. Return the number in its answer."""
    answer = rig.bus.node_setup(3, node_number=9, t1_delay=0.26, t2_delay=25.54, position_type=2)
    info = rig.bus.node(9).node_info()
    assert (info.t1_delay, info.t2_delay, info.position_type) == (0.3, 25.5, PositionType.METRONIX)
    with pytest.raises(NoReply):
        rig.bus.node_info(3)
    return answer.node


class TestSetup:
    def test_a_new_number_is_answered_under_it(self, make_clean: MakeRig) -> None:
        assert set_up_as_9(make_clean(Slave(3))) == 9

    def test_a_new_number_is_answered_under_the_old_one(self, make_simulated: MakeRig) -> None:
        # The firmware answers with the other number.
        assert set_up_as_9(make_simulated(Slave(3, old_number=True))) == 3

    def test_settings_arrive_on_a_bad_line(self, make: MakeRig) -> None:
        rig = make(Slave(3, serial_number=0xA5A5A5A5))
        rig.sure(lambda: rig.bus.node_setup(3, node_number=3, t1_delay=16.5, t2_delay=0.0, position_type=1))
        info = rig.sure(lambda: rig.bus.node_info(3))
        assert (info.t1_delay, info.t2_delay, info.position_type) == (16.5, 0.0, PositionType.JVL_MACTALK)
        assert info.serial_number == 0xA5A5A5A5

    def test_a_broadcast_finds_the_only_node(self, make: MakeRig) -> None:
        rig = make(Slave(11, serial_number=77))
        info = rig.sure(lambda: rig.bus.node_info(0))
        assert (info.node, info.serial_number) == (11, 77)
        assert rig.sure(lambda: rig.bus.node_setup(0, node_number=4)).node == 4
        assert rig.node.number == 4

    def test_a_broadcast_to_two_nodes_collides(self, make_clean: MakeRig) -> None:
        rig = make_clean(Slave(2, serial_number=2), Slave(5, serial_number=5))
        if rig.paced:
            with pytest.raises(LinkError):
                rig.bus.node_info(0)
            assert rig.wire.collisions == 3
        else:  # without line time they do not collide: one of both is the answer, the other a stray
            info = rig.bus.node_info(0)
            assert info.node == info.serial_number
            other = rig.bus.motor_position(2 if info.node == 5 else 5)
            assert other.node != info.node
            assert rig.bus.engine.total.strays == 1

    def test_scan_finds_who_is_there(self, make: MakeRig) -> None:
        rig = make(Slave(2, unsupported=("node_info",)), Slave(5, serial_number=5))
        found: list[Found] = []
        for _ in range(100 if rig.faulty else 1):
            found = [each for each in rig.bus.scan((1, 2, 5)) if not each.garbled]
            assert {each.node for each in found} <= {2, 5}
            if len(found) == 2 and found[1].info is not None:
                break
        assert [each.node for each in found] == [2, 5]
        assert found[0].info is None
        assert found[1].info is not None
        assert found[1].info.serial_number == 5

    def test_status_tells_what_each_node_says(self, make: MakeRig) -> None:
        rig = make(Slave(1, position_type=1), Slave(2))
        rig.nodes[0].position = -99
        rig.nodes[1].inputs = 0xA5A5A4
        first = second = None
        for _ in range(100 if rig.faulty else 1):
            first, second, absent = rig.bus.status((1, 2, 3))
            assert first.position in {None, -99}
            assert second.inputs in {None, 0xA5A5A4}
            assert not absent.online
            if first.position is not None and second.inputs is not None:
                break
        assert first is not None
        assert second is not None
        assert (first.position, second.inputs) == (-99, 0xA5A5A4)
