"""Motions, FIFO and position of the virtual node (sections 7.10 to 7.13)."""

from __future__ import annotations

from array import array
from copy import deepcopy

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qlinkgen.codecs import qlink
from qlinkgen.codecs.qlink import MotorStatus, PositionType
from qlinkgen.protocols.qlink.path_fifo import PathFifo, signed_word, wrapped
from qlinkgen.protocols.qlink.virtual_node import VirtualNode

RUNNING, VALID = MotorStatus.RUNNING, MotorStatus.POSITION_VALID


def move(
    node: VirtualNode, counter: int, words: list[int], now: float = 0.0, outputs: int = 0
) -> qlink.MotionResponse | None:
    request = qlink.MotionRequest(node=node.number, counter=counter, outputs=outputs, segments=words)
    response = node.handle(qlink.decode_request(request.to_frame()), now)
    if response is None:
        return None
    answer = qlink.decode_response(response.to_frame())
    assert isinstance(answer, qlink.MotionResponse)
    return answer


def tell(node: VirtualNode, request: qlink.Message, now: float = 0.0) -> qlink.Message | None:
    return node.handle(qlink.decode_request(request.to_frame()), now)


class TestDraining:
    def test_a_stopped_node_holds_its_words(self) -> None:
        node = VirtualNode(rate=10)
        answer = move(node, 0, [1, 2, 3], 0.0)
        assert answer == qlink.MotionResponse(node=1, counter=0, fifo_space=45)
        answer = move(node, 1, [], 100.0)
        assert answer is not None
        assert (answer.fifo_space, answer.motor_status & RUNNING) == (45, 0)

    def test_words_go_one_by_one_from_the_start_on(self) -> None:
        node = VirtualNode(rate=10, position_type=PositionType.JVL_MACTALK)
        move(node, 0, [100, 0xFFFF, 10], 0.0)
        tell(node, qlink.NodeStartRequest(node=0), 50.0)
        seen = []
        for counter, now in enumerate((50.0, 50.09, 50.1, 50.2, 50.29, 50.3, 60.0), start=1):
            answer = move(node, counter, [], now)
            assert answer is not None
            seen.append((answer.fifo_space, answer.position, answer.motor_status))
        assert seen == [
            (45, 0, RUNNING | VALID),
            (45, 0, RUNNING | VALID),
            (46, 100, RUNNING | VALID),
            (47, 99, RUNNING | VALID),
            (47, 99, RUNNING | VALID),
            (48, 109, VALID),
            (48, 109, VALID),
        ]

    def test_a_stream_keeps_its_beat(self) -> None:
        node = VirtualNode(rate=10, started=True)
        move(node, 0, [1, 1], 0.0)
        move(node, 1, [1, 1], 0.15)
        node.advance(0.4)
        assert (node.position, node.running) == (4, False)

    def test_a_pause_begins_a_new_beat(self) -> None:
        node = VirtualNode(rate=10, started=True)
        move(node, 0, [1], 0.0)
        move(node, 1, [1], 0.55)
        node.advance(0.64)
        assert node.position == 1
        node.advance(0.65)
        assert node.position == 2

    def test_a_stop_holds_and_the_word_begins_again(self) -> None:
        node = VirtualNode(rate=10)
        move(node, 0, [1, 1, 1], 0.0)
        tell(node, qlink.NodeStartRequest(node=1), 0.0)
        tell(node, qlink.NodeStartRequest(node=1), 0.05)  # changes nothing
        tell(node, qlink.NodeStopRequest(node=1), 0.15)
        assert (node.position, node.running) == (1, False)
        node.advance(9.0)
        assert node.position == 1
        tell(node, qlink.NodeStartRequest(node=1), 9.0)
        node.advance(9.09)
        assert node.position == 1
        node.advance(9.2)
        assert node.position == 3

    def test_a_rate_of_0_never_moves_and_can_be_changed(self) -> None:
        node = VirtualNode(rate=0, started=True)
        move(node, 0, [1, 1, 1, 1], 0.0)
        node.advance(1e9)
        assert (node.position, node.running) == (0, True)
        node.path.set_rate(2.0, node.advance(1e9))
        node.advance(1e9 + 1.0)
        assert (node.position, node.path.rate) == (2, 2.0)
        node.path.set_rate(4.0, 1e9 + 1.5)
        assert node.position == 3
        node.advance(1e9 + 1.75)
        assert node.position == 4
        with pytest.raises(ValueError, match="rate=-1 must be 0 or more words per second"):
            node.path.set_rate(-1, 1e9 + 2)

    def test_any_rate_is_taken(self) -> None:
        node = VirtualNode(rate=1e308, started=True)
        move(node, 0, [1] * 12, 0.0)
        node.advance(1e300)
        assert node.position == 12

    def test_what_a_word_means_is_the_users(self) -> None:
        node = VirtualNode(rate=10, started=True, displacement=lambda word: -word)
        move(node, 0, [0xFFFF], 0.0)
        node.advance(1.0)
        assert node.position == -65535

    def test_a_position_is_of_32_bits(self) -> None:
        node = VirtualNode(rate=10, started=True, position_type=2)
        tell(node, qlink.PresetMotorPositionRequest(node=1, position=2**31 - 1))
        move(node, 0, [2], 0.0)
        answer = move(node, 1, [], 0.1)
        assert answer is not None
        assert answer.position == -(2**31) + 1

    def test_a_fifo_alone_keeps_its_own_time(self) -> None:
        fifo = PathFifo(2, 10.0, started=True)
        assert fifo.push([1, 2], 0.0)
        assert not fifo.push([3, 4], 0.15)
        assert fifo.push([3], 0.15)
        assert (fifo.position, fifo.waiting, fifo.drained) == (1, 2, 1)

    @given(st.integers(0, 0xFFFF))
    def test_a_word_is_in_twos_complement(self, word: int) -> None:
        assert signed_word(word) == int.from_bytes(word.to_bytes(2, "big"), "big", signed=True)

    @given(st.integers(-(2**70), 2**70))
    def test_a_position_wraps_in_twos_complement(self, position: int) -> None:
        assert wrapped(position) == int.from_bytes((position % 2**32).to_bytes(4, "big"), "big", signed=True)


class TestCounter:
    @pytest.mark.parametrize("counter", [0, 1, 255])
    def test_a_repeat_is_answered_but_not_taken_again(self, counter: int) -> None:
        node = VirtualNode(rate=10, started=True, position_type=1, record=True)
        move(node, counter, [1, 2], 0.0, outputs=0x0F)
        answer = move(node, counter, [1, 2], 0.1, outputs=0xF0)
        assert answer == qlink.MotionResponse(
            node=1, counter=counter, position=1, motor_status=RUNNING | VALID, fifo_space=47
        ), "with the present state"
        assert node.outputs == 0x0F
        assert (node.statistics.motions, node.statistics.duplicates, node.statistics.words) == (1, 1, 2)
        assert node.record is not None
        assert list(node.record.words) == [1, 2]

    def test_a_repeat_is_none_after_another_motion(self) -> None:
        node = VirtualNode()
        for counter in (0, 1, 0):
            move(node, counter, [1])
        assert (node.path.waiting, node.statistics.duplicates) == (3, 0)

    @pytest.mark.parametrize(
        ("counters", "jumps"), [([9], 0), ([0, 1, 2], 0), ([254, 255, 0], 0), ([0, 2, 1], 2), ([3, 3, 4], 0)]
    )
    def test_jumps_are_counted(self, counters: list[int], jumps: int) -> None:
        node = VirtualNode()
        for counter in counters:
            move(node, counter, [])
        assert node.statistics.jumps == jumps

    def test_after_a_clear_the_same_counter_is_new(self) -> None:
        node = VirtualNode(rate=10, started=True)
        move(node, 7, [1, 1, 1], 0.0)
        cleared = tell(node, qlink.ClearFifoRequest(node=1), 0.15)
        assert cleared == qlink.ClearFifoResponse(node=1)
        assert (node.path.waiting, node.position, node.running, node.path.started) == (0, 1, False, True)
        move(node, 7, [5], 0.15)
        assert (node.path.waiting, node.statistics.duplicates, node.statistics.jumps) == (1, 0, 0)
        node.advance(0.24)
        assert node.position == 1, "with a beat of its own"
        node.advance(0.25)
        assert node.position == 6, "from its last position"

    def test_a_motion_without_words_only_reads(self) -> None:
        node = VirtualNode(capacity=0)
        answer = move(node, 0, [])
        assert answer is not None
        assert answer.fifo_space == 0


class TestOverrun:
    def test_nothing_of_it_is_taken_and_it_is_not_answered(self) -> None:
        node = VirtualNode(capacity=5, rate=10, started=True, record=True)
        move(node, 0, [1, 1, 1], 0.0, outputs=1)
        assert move(node, 1, [2, 2, 2], 0.0, outputs=2) is None
        assert (node.path.waiting, node.outputs, node.statistics.overruns) == (3, 1, 1)
        answer = move(node, 1, [2, 2, 2], 0.1, outputs=2)
        assert answer is not None, "its repeat fits by now"
        assert (answer.fifo_space, node.outputs) == (0, 2)
        assert (node.statistics.motions, node.statistics.duplicates, node.statistics.jumps) == (2, 0, 0)
        assert node.record is not None
        assert node.record.words == array("H", [1, 1, 1, 2, 2, 2])
        assert node.record.times == array("d", [0.0] * 3 + [0.1] * 3)

    def test_as_much_as_fits_is_no_overrun(self) -> None:
        node = VirtualNode(capacity=12)
        answer = move(node, 0, [0] * 12)
        assert answer is not None
        assert (answer.fifo_space, node.statistics.overruns) == (0, 0)

    def test_a_capacity_of_255_is_told(self) -> None:
        answer = move(VirtualNode(capacity=255), 0, [])
        assert answer is not None
        assert answer.fifo_space == 255


class TestPosition:
    @pytest.mark.parametrize(("kind", "valid"), [(0, False), (1, True), (2, True), (3, False), (255, False)])
    def test_it_is_valid_with_a_type_that_the_document_names(self, kind: int, valid: bool) -> None:
        node = VirtualNode(rate=10, started=True, position_type=kind)
        move(node, 0, [8], 0.0)
        answer = move(node, 1, [], 0.1)
        assert answer is not None
        assert (answer.position, answer.motor_status) == ((8, VALID) if valid else (0, 0))
        position = tell(node, qlink.MotorPositionRequest(node=1), 0.1)
        assert position == qlink.MotorPositionResponse(node=1, position=8 if valid else 0)
        assert node.position == 8

    def test_a_new_node_has_none(self) -> None:
        answer = move(VirtualNode(), 0, [])
        assert answer is not None
        assert answer.motor_status == 0

    def test_a_preset_is_refused_while_the_motor_runs(self) -> None:
        node = VirtualNode(rate=10, position_type=1)
        preset = qlink.PresetMotorPositionRequest(node=1, position=-(2**31))
        move(node, 0, [1], 0.0)
        assert tell(node, preset, 0.0) == qlink.PresetMotorPositionResponse(node=1), "words wait, but stopped"
        tell(node, qlink.NodeStartRequest(node=1), 0.0)
        assert tell(node, qlink.PresetMotorPositionRequest(node=1, position=5), 0.05) is None
        assert (node.position, node.statistics.refused_presets) == (-(2**31), 1)
        answer = tell(node, qlink.PresetMotorPositionRequest(node=1, position=5), 0.1)
        assert answer == qlink.PresetMotorPositionResponse(node=1), "started, but without words"
        assert node.position == 5


class TestConservation:
    steps = st.lists(
        st.one_of(
            st.tuples(st.just("push"), st.lists(st.integers(0, 0xFFFF), max_size=12)),
            st.tuples(st.just("advance"), st.floats(0, 3)),
            st.tuples(st.just("start"), st.none()),
            st.tuples(st.just("stop"), st.none()),
            st.tuples(st.just("clear"), st.none()),
            st.tuples(st.just("rate"), st.floats(0, 50)),
        ),
        max_size=40,
    )

    @given(steps=steps, capacity=st.integers(0, 255), rate=st.floats(0, 100))
    def test_no_word_is_lost_or_made(
        self, steps: list[tuple[str, object]], capacity: int, rate: float
    ) -> None:
        fifo, now, queued = PathFifo(capacity, rate), 0.0, []
        dropped = 0
        for step, value in steps:
            if step == "push":
                assert isinstance(value, list)
                space = fifo.space
                assert fifo.push(value, now) is (len(value) <= space)
                queued += value if len(value) <= space else []
            elif step == "clear":
                dropped += fifo.waiting
                # Dropped words do not move the motor: remove them from the sum compared below.
                del queued[len(queued) - fifo.waiting :]
                fifo.clear()
            elif step == "start":
                fifo.start(now)
            elif step == "stop":
                fifo.stop()
            elif step == "rate":
                assert isinstance(value, float)
                fifo.set_rate(value, now)
            else:
                assert isinstance(value, float)
                now += value
                fifo.advance(now)
            assert fifo.queued == fifo.drained + fifo.dropped + fifo.waiting
            assert 0 <= fifo.waiting <= capacity
            done = queued[: len(queued) - fifo.waiting]
            assert fifo.position == sum(map(signed_word, done)), "the finished words moved it, in order"
        assert fifo.dropped == dropped

    @given(st.lists(st.floats(0.001, 0.7), min_size=1, max_size=30), st.integers(1, 48))
    def test_looking_on_the_way_changes_nothing(self, pauses: list[float], words: int) -> None:
        watched, alone = (PathFifo(48, 20.0, started=True) for _ in range(2))
        for fifo in (watched, alone):
            fifo.push([1] * words, 0.0)
        now = 0.0
        for pause in pauses:
            now += pause
            watched.advance(now)
        alone.advance(now)
        assert (watched.position, watched.waiting) == (alone.position, alone.waiting)

    @given(
        counter=st.integers(0, 255),
        first=st.lists(st.integers(0, 0xFFFF), max_size=12),
        again=st.lists(st.integers(0, 0xFFFF), max_size=12),
        repeats=st.integers(1, 5),
        later=st.floats(0, 1),
    )
    def test_a_repeat_changes_no_state(
        self, counter: int, first: list[int], again: list[int], repeats: int, later: float
    ) -> None:
        node = VirtualNode(rate=5, started=True, record=True, position_type=1)
        move(node, counter, first, 0.0, outputs=0x5A)
        node.advance(later)
        before = deepcopy(node)
        answers = [move(node, counter, again, later, outputs=0xA5) for _ in range(repeats)]
        assert answers == answers[:1] * repeats
        assert node.statistics.duplicates == repeats
        for one in (before, node):
            one.statistics.requests = one.statistics.duplicates = 0
        assert (node.io.outputs, node.path.waiting, node.position) == (
            before.io.outputs,
            before.path.waiting,
            before.position,
        )
        assert (node.statistics, node.record) == (before.statistics, before.record)
        node.advance(later + 100)
        before.advance(later + 100)
        assert node.position == before.position

    @given(st.lists(st.lists(st.integers(0, 0xFFFF), max_size=12), max_size=20), st.data())
    def test_a_stream_with_lost_answers_arrives_whole(
        self, motions: list[list[int]], data: st.DataObject
    ) -> None:
        node = VirtualNode(rate=50, started=True, record=True)
        now = 0.0
        for number, words in enumerate(motions):
            answer = None
            while answer is None or data.draw(st.booleans(), label="answer lost"):
                now += 0.1
                answer = move(node, number % 256, words, now)
        assert node.record is not None
        assert list(node.record.words) == [word for words in motions for word in words]
        node.advance(now + 10)
        assert node.path.drained == node.statistics.words
