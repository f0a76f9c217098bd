"""Dialogues of several frames: master, slave and monitor."""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType
from typing import Any

import pytest

from qlinkgen.backends.python import load as load_codec
from qlinkgen.errors import LinkError, NoReply, Refused
from qlinkgen.link import Dialogue, MasterEngine, Monitor, Refusal, SlaveEngine, Timing
from qlinkgen.link.dialogue import Further
from qlinkgen.link.monitor import Asked, Replied, Unanswered
from qlinkgen.schema import loads
from qlinkgen.sim import FaultPlan, VirtualPort, Wire
from qlinkgen.sim.generic import GenericNode
from qlinkgen.transport.blocking import BlockingMaster
from tests.link.line import drive

SCHEMA = """\
qlinkgen: 1
protocol: {name: loader, title: Loader, revision: "1", source: Manual}
frame:
  parts:
    start: 7E
    node: {role: address, type: u8}
    code: {role: message, type: u8}
    length: {type: u8, counts: [data]}
    data: {role: payload, size: 0..20}
    crc: {type: u16, algorithm: crc-16/modbus, over: [node, code, length, data]}
bus: {kind: master_slave, nodes: 1..9, broadcast: 0, baud: 9600, response_within: 10 ms}
defaults: {addressing: node, repeat: safe}
messages:
  ack: {id: 0x79, direction: response, fields: {}}
replies:
  nack: {id: 0x1F, fields: {reason: u8}}
  busy: {id: 0x1E, fields: {}, means: again}
  wait: {id: 0x1D, fields: {}, means: pending, within: 500 ms}
  empty: {id: 0x1C, fields: {}, means: done}
commands:
  read:
    id: 0x11
    request: {}
    steps:
      - {send: request}
      - {receive: ack}
      - {name: place, send: {id: 0x12, fields: {start: u32}}, within: 200 ms}
      - {receive: ack}
      - {name: amount, send: {id: 0x13, fields: {count: {type: u8, range: 1..16}}}}
      - {receive: ack}
      - {name: data, receive: {fields: {data: "bytes[amount.count]"}}, within: 100 ms}
  confirm:
    id: 0x21
    request: {number: u8}
    response: {number: {type: u8, echo: true}, value: u16}
    steps:
      - {receive: response}
      - {name: taken, send: {id: 0x22, fields: {}}}
  taken: {id: 0x23, request: {}, response: {count: u8}}
  once:
    id: 0x31
    request: {}
    repeat: unsafe
    steps: [{receive: ack}, {name: last, receive: {fields: {value: u8}}}]
"""
SLACK = 0.002


@pytest.fixture(scope="module")
def loader() -> ModuleType:
    protocol, faults = loads(SCHEMA, "loader.yaml")
    assert protocol is not None, faults
    return load_codec(protocol)


@pytest.fixture
def engine(loader: ModuleType) -> MasterEngine:
    return MasterEngine(loader, Timing.of(loader, host_slack=SLACK))


class Memory:
    """A node that reads back where and how much it was asked for."""

    number = 3

    def __init__(self, loader: ModuleType) -> None:
        self._codec = loader
        self.confirmed = 0
        self.ends = 0
        #: What to answer instead, by the number of the frame in the dialogue.
        self.instead: dict[int, list[Any]] = {}

    def handle(self, request: Any, now: float) -> Any:
        codec = self._codec
        if type(request) is codec.ReadRequest:
            return self._read()
        if type(request) is codec.ConfirmRequest:
            return self._confirm(request)
        if type(request) is codec.OnceRequest:
            return [codec.Ack(node=3), codec.OnceLast(node=3, value=9)]
        return codec.TakenResponse(node=3, count=self.confirmed)

    def _other(self, place: int) -> Any:
        left = self.instead.get(place)
        return left.pop(0) if left else None

    def _read(self) -> Any:
        codec, ack = self._codec, self._codec.Ack(node=3)
        try:
            place = yield self._other(0) or ack
            while other := self._other(1):
                place = yield other
            amount = yield ack
            while other := self._other(2):
                amount = yield other
            data = (place.start + amount.count).to_bytes(4, "big") * 4
            return [ack, codec.ReadData(node=3, data=data[: amount.count])]
        finally:
            self.ends += 1

    def _confirm(self, request: Any) -> Any:
        yield self._codec.ConfirmResponse(node=3, number=request.number, value=7)
        self.confirmed += 1


def bus(
    loader: ModuleType, node: Any, *, faults: FaultPlan | None = None, attempts: int = 3
) -> tuple[BlockingMaster, SlaveEngine]:
    wire = Wire(baud=9600, faults=faults)
    slave = SlaveEngine(loader, node, baud=9600, turnaround=0.003)
    wire.attach(slave, "node 3")
    timing = Timing.of(loader, host_slack=SLACK, attempts=attempts)
    return BlockingMaster(MasterEngine(loader, timing), VirtualPort(wire)), slave


def reading(loader: ModuleType, start: int, count: int) -> Dialogue:
    return Dialogue(
        loader.ReadRequest(node=3),
        [loader.ReadPlace(node=3, start=start), lambda _: loader.ReadAmount(node=3, count=count)],
    )


def data_of(start: int, count: int) -> bytes:
    return ((start + count).to_bytes(4, "big") * 4)[:count]


def test_all_answers_are_returned_in_their_order(loader: ModuleType) -> None:
    node = Memory(loader)
    master, slave = bus(loader, node)
    reply = master.transact(reading(loader, 0x1000, 7))
    ack = loader.Ack(node=3)
    assert reply.response == (ack, ack, ack, loader.ReadData(node=3, data=data_of(0x1000, 7)))
    assert (reply.attempts, node.ends, slave.counters.answers) == (1, 1, 4)


def test_acknowledgements_of_one_byte() -> None:
    head, tail = SCHEMA.split("frame:\n", maxsplit=1)[0], SCHEMA.split("bus:")[1]
    kinds = """\
frames:
  block:
    parts:
      start: 7E
      code: {role: message, type: u8}
      length: {type: u8, counts: [data]}
      data: {role: payload, size: 0..20}
      crc: {type: u16, algorithm: crc-16/modbus, over: [code, length, data]}
  ack: {parts: {byte: 79}}
  nack: {parts: {byte: 1F}}
bus: {kind: master_slave, baud: 9600, response_within: 10 ms}
defaults: {repeat: safe, frame: block}
"""
    tail = tail[tail.index("messages:") : tail.index("  confirm:")].replace(
        "{id: 0x79, direction", "{frame: ack, direction"
    )
    tail = tail.replace("nack: {id: 0x1F, fields: {reason: u8}}", "nack: {frame: nack, fields: {}}")
    protocol, faults = loads(head + kinds + tail, "loader.yaml")
    assert protocol is not None, faults
    codec = load_codec(protocol)
    wire = Wire(baud=9600)
    wire.attach(SlaveEngine(codec, GenericNode(codec), baud=9600, turnaround=0.003), "node")
    master = BlockingMaster(MasterEngine(codec, Timing.of(codec, host_slack=SLACK)), VirtualPort(wire))
    further = [codec.ReadPlace(start=1), codec.ReadAmount(count=1)]
    *acknowledged, data = master.transact(Dialogue(codec.ReadRequest(), further)).response
    assert acknowledged == [codec.Ack()] * 3
    assert codec.Ack().to_frame() == b"\x79"
    assert data == codec.ReadData(data=b"\0")


def test_a_choice_in_a_step(loader: ModuleType) -> None:
    fields = "{kind: {type: u8, range: 1..2}, value: {switch: kind, cases: {1: u16, 2: u32}}}"
    protocol, faults = loads(
        SCHEMA.replace("fields: {start: u32}}, within", f"fields: {fields}}}, within"), "x"
    )
    assert protocol is not None, faults
    found = protocol.by_name["read.place"]
    assert (found.min_size, found.max_size) == (1, 5)


def test_a_function_gets_the_answers_so_far(loader: ModuleType) -> None:
    seen: list[Sequence[Any]] = []

    def amount(answers: Sequence[Any]) -> Any:
        seen.append(answers)
        return loader.ReadAmount(node=3, count=2)

    master, _ = bus(loader, Memory(loader))
    further: list[Further] = [loader.ReadPlace(node=3, start=1), amount]
    assert master.transact(Dialogue(loader.ReadRequest(node=3), further)).response[-1].data == data_of(1, 2)
    assert seen == [(loader.Ack(node=3), loader.Ack(node=3))]


def test_a_frame_of_the_dialogue_says_the_size_of_the_answer(
    loader: ModuleType, engine: MasterEngine
) -> None:
    master, _ = bus(loader, GenericNode(loader, 3))
    assert len(master.transact(reading(loader, 1, 3)).response[-1].data) == 3
    ack, short, right = (
        loader.Ack(node=3),
        loader.ReadData(node=3, data=b"1"),
        loader.ReadData(node=3, data=b"12"),
    )
    times = (0.012, 0.032, 0.052, 0.06, 0.07)
    arrivals = [(at, each.to_frame()) for at, each in zip(times, (ack, ack, ack, short, right), strict=True)]
    assert drive(engine, reading(loader, 1, 2), arrivals).response[-1] == right
    slave = SlaveEngine(loader, GenericNode(loader, 3), baud=9600)
    slave.node.handle = lambda request, now: answering(loader)  # type: ignore[method-assign]
    for message in (loader.ReadRequest(node=3), loader.ReadPlace(node=3, start=1)):
        slave.receive(message.to_frame(), 0.0)
    with pytest.raises(ValueError, match=r"read\.data: data has 1 items; count of read\.amount asks for 2"):
        slave.receive(loader.ReadAmount(node=3, count=2).to_frame(), 0.0)


def answering(loader: ModuleType) -> Any:
    """The answers of a node to frames of one dialogue, the last one with another size than asked for."""
    yield loader.Ack(node=3)
    yield loader.Ack(node=3)
    yield [loader.Ack(node=3), loader.ReadData(node=3, data=b"1")]


def test_a_master_confirms_the_answer(loader: ModuleType) -> None:
    node = Memory(loader)
    master, _ = bus(loader, node)
    dialogue = Dialogue(loader.ConfirmRequest(node=3, number=5), [loader.ConfirmTaken(node=3)])
    assert master.transact(dialogue).response == (loader.ConfirmResponse(node=3, number=5, value=7),)
    assert master.transact(loader.TakenRequest(node=3)).response.count == 1


def test_a_slave_sends_data_after_it_acknowledged(loader: ModuleType) -> None:
    master, _ = bus(loader, Memory(loader))
    assert master.transact(loader.OnceRequest(node=3)).response[-1].value == 9


@pytest.mark.parametrize(
    ("further", "error"),
    [
        (lambda codec: [], ValueError),
        (lambda codec: [codec.ReadPlace(node=3, start=1)] * 2, TypeError),
        (lambda codec: [codec.ReadPlace(node=4, start=1), codec.ReadAmount(node=3, count=1)], ValueError),
        (lambda codec: [codec.ReadPlace(node=3, start=1), codec.ReadAmount(node=3, count=99)], ValueError),
    ],
)
def test_wrong_frames_are_refused_before_any_is_sent(
    loader: ModuleType, engine: MasterEngine, further: Any, error: type[Exception]
) -> None:
    with pytest.raises(error):
        engine.start(Dialogue(loader.ReadRequest(node=3), further(loader)), 0.0)
    assert not engine.busy


def test_a_wrong_frame_of_a_function_ends_the_transaction(loader: ModuleType) -> None:
    master, _ = bus(loader, Memory(loader))
    dialogue = Dialogue(loader.ReadRequest(node=3), [lambda _: loader.ReadAmount(node=3, count=1)] * 2)
    with pytest.raises(TypeError, match="the next frame is ReadPlace, not ReadAmount"):
        master.transact(dialogue)
    assert master.transact(reading(loader, 1, 1)).response[-1].data == data_of(1, 1)


@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_refusal_ends_it_anywhere(loader: ModuleType, place: int) -> None:
    node = Memory(loader)
    node.instead[place] = [loader.Nack(node=3, reason=4)]
    master, _ = bus(loader, node)
    with pytest.raises(Refused, match="refused by node 3: 4"):
        master.transact(reading(loader, 0, 1))
    assert node.ends == 1
    assert master.transact(reading(loader, 0, 1)).response[-1].data == data_of(0, 1)


def test_a_raised_refusal(loader: ModuleType) -> None:
    class Refusing(Memory):
        def _read(self) -> Any:
            yield self._codec.Ack(node=3)
            raise Refusal(self._codec.Nack(node=3, reason=2))

    master, _ = bus(loader, Refusing(loader))
    with pytest.raises(Refused, match="2"):
        master.transact(reading(loader, 0, 1))


def test_another_answer_than_the_steps(loader: ModuleType) -> None:
    node = Memory(loader)
    node.instead[1] = [loader.Empty(node=3)]
    master, _ = bus(loader, node)
    assert master.transact(reading(loader, 0, 1)).response == loader.Empty(node=3)


def test_the_last_frame_is_sent_again(loader: ModuleType) -> None:
    node = Memory(loader)
    node.instead[1] = [loader.Busy(node=3)]
    master, slave = bus(loader, node)
    reply = master.transact(reading(loader, 5, 3))
    assert reply.response[-1].data == data_of(5, 3)
    assert (reply.attempts, slave.counters.requests, len(reply.response)) == (2, 4, 4)


def test_a_slave_answers_a_step_later(loader: ModuleType) -> None:
    asked: list[Any] = []

    class Slow(Memory):
        def _read(self) -> Any:
            place = yield self._codec.Ack(node=3)
            asked.append(place)
            amount = yield self._codec.Wait(node=3)
            data = data_of(place.start, amount.count)
            return [self._codec.Ack(node=3), self._codec.ReadData(node=3, data=data)]

    slave = SlaveEngine(loader, Slow(loader), baud=9600)
    slave.receive(loader.ReadRequest(node=3).to_frame(), 0.0)
    assert slave.bytes_to_send(0.01) == loader.Ack(node=3).to_frame()
    place = loader.ReadPlace(node=3, start=8)
    slave.receive(place.to_frame(), 0.02)
    assert slave.bytes_to_send(0.03) == loader.Wait(node=3).to_frame()
    slave.answer(asked[0], loader.Ack(node=3), 0.1)
    assert slave.bytes_to_send(0.2) == loader.Ack(node=3).to_frame()
    slave.receive(loader.ReadAmount(node=3, count=1).to_frame(), 0.3)
    assert slave.bytes_to_send(0.4) == loader.Ack(node=3).to_frame()
    assert slave.bytes_to_send(0.6) == loader.ReadData(node=3, data=data_of(8, 1)).to_frame()


def test_frames_out_of_turn_are_not_answered(loader: ModuleType) -> None:
    node = Memory(loader)
    slave = SlaveEngine(loader, node, baud=9600)
    amount = loader.ReadAmount(node=3, count=1).to_frame()
    slave.receive(amount, 0.0)
    assert slave.bytes_to_send(1.0) == b""
    slave.receive(loader.ReadRequest(node=3).to_frame(), 1.0)
    assert slave.bytes_to_send(1.1)
    slave.receive(amount, 1.11)  # the place was due
    assert slave.bytes_to_send(2.0) == b""
    slave.receive(loader.ReadPlace(node=3, start=1).to_frame(), 2.0)  # the dialogue is over
    assert (slave.bytes_to_send(3.0), slave.counters.untimely, node.ends) == (b"", 3, 1)


def test_a_slave_does_not_wait_for_ever(loader: ModuleType) -> None:
    for late, answered in ((0.19, True), (0.3, False)):
        slave = SlaveEngine(loader, Memory(loader), baud=9600)
        slave.receive(loader.ReadRequest(node=3).to_frame(), 0.0)
        assert slave.bytes_to_send(0.0)
        slave.receive(loader.ReadPlace(node=3, start=1).to_frame(), late)
        assert bool(slave.bytes_to_send(9.0)) is answered


def test_another_request_ends_it(loader: ModuleType) -> None:
    node = Memory(loader)
    slave = SlaveEngine(loader, node, baud=9600)
    slave.receive(loader.ReadRequest(node=3).to_frame(), 0.0)
    slave.receive(loader.TakenRequest(node=3).to_frame(), 0.1)
    assert slave.bytes_to_send(0.2) == loader.TakenResponse(node=3, count=0).to_frame()
    assert node.ends == 1


def test_a_slave_answers_only_what_is_due(loader: ModuleType) -> None:
    node = Memory(loader)
    node.instead[0] = [loader.ReadData(node=3, data=b"1")]
    slave = SlaveEngine(loader, node, baud=9600)
    with pytest.raises(ValueError, match=r"read\.data is not due in read: Ack is"):
        slave.receive(loader.ReadRequest(node=3).to_frame(), 0.0)


def test_frames_of_others_do_not_disturb_a_step(loader: ModuleType, engine: MasterEngine) -> None:
    ack, other = loader.Ack(node=3).to_frame(), loader.Ack(node=4).to_frame()
    data = loader.ReadData(node=3, data=b"12").to_frame()
    arrivals = [
        (0.010, other), (0.012, ack), (0.030, data), (0.032, ack), (0.050, other), (0.052, ack), (0.06, data),
    ]  # fmt: skip
    run = drive(engine, reading(loader, 1, 2), arrivals)
    assert [type(each).__name__ for each in run.response] == ["Ack", "Ack", "Ack", "ReadData"]
    assert engine.counters[3].strays == 1


def test_a_missing_answer_repeats_the_whole_dialogue(loader: ModuleType, engine: MasterEngine) -> None:
    ack = loader.Ack(node=3).to_frame()
    run = drive(engine, reading(loader, 1, 2), [(0.012, ack)], attempts=2)
    assert isinstance(run.error, NoReply)
    request, place = loader.ReadRequest(node=3).to_frame(), loader.ReadPlace(node=3, start=1).to_frame()
    assert run.frames == [request, place, request]


def test_an_unsafe_dialogue_is_not_repeated(loader: ModuleType, engine: MasterEngine) -> None:
    run = drive(engine, loader.OnceRequest(node=3), [(0.012, loader.Ack(node=3).to_frame())])
    assert isinstance(run.error, NoReply)
    assert len(run.sent) == 1


def test_the_worst_case_has_all_steps(loader: ModuleType, engine: MasterEngine) -> None:
    worst = {name: engine.timing.worst_case(each) for name, each in loader.COMMANDS.items()}
    assert worst["taken"] < worst["confirm"] < worst["read"] < 4.0


def test_a_node_of_the_schema_alone(loader: ModuleType) -> None:
    master, _ = bus(loader, GenericNode(loader, 3))
    assert [type(each).__name__ for each in master.transact(reading(loader, 1, 1)).response] == [
        "Ack", "Ack", "Ack", "ReadData",
    ]  # fmt: skip
    dialogue = Dialogue(loader.ConfirmRequest(node=3, number=5), [loader.ConfirmTaken(node=3)])
    assert master.transact(dialogue).response[0].number == 5


def heard(loader: ModuleType, frames: Sequence[Any], every: float = 0.015) -> list[tuple[str, str]]:
    monitor = Monitor(loader, Timing.of(loader, host_slack=SLACK))
    for index, message in enumerate(frames):
        monitor.receive(message.to_frame(), every * (index + 1))
    monitor.finish(every * len(frames) + 1)
    return [(type(event).__name__, said(event)) for event in monitor.heard]


def said(event: Any) -> str:
    if isinstance(event, Replied):
        return f"{event.response.NAME} to {event.request.NAME}"
    message = event.request if isinstance(event, Asked | Unanswered) else event.message
    return str(message.NAME)


def test_a_monitor_pairs_the_frames(loader: ModuleType) -> None:
    ack = loader.Ack(node=3)
    frames = [
        loader.ReadRequest(node=3), ack, loader.ReadPlace(node=3, start=1), ack,
        loader.ReadAmount(node=3, count=2), ack, loader.ReadData(node=3, data=b"12"),
        loader.TakenRequest(node=3), loader.TakenResponse(node=3, count=1),
    ]  # fmt: skip
    assert heard(loader, frames) == [
        ("Asked", "read.request"), ("Replied", "ack to read.request"),
        ("Asked", "read.place"), ("Replied", "ack to read.place"),
        ("Asked", "read.amount"), ("Replied", "ack to read.amount"), ("Replied", "read.data to read.amount"),
        ("Asked", "taken.request"), ("Replied", "taken.response to taken.request"),
    ]  # fmt: skip
    assert heard(loader, [*frames[:6], loader.ReadData(node=3, data=b"1")])[6:] == [
        ("Stray", "read.data"), ("Unanswered", "read.amount"),
    ]  # fmt: skip


def test_a_monitor_leaves_a_dialogue(loader: ModuleType) -> None:
    ack, place = loader.Ack(node=3), loader.ReadPlace(node=3, start=1)
    assert heard(loader, [loader.ReadRequest(node=3), ack, loader.TakenRequest(node=3), place]) == [
        ("Asked", "read.request"), ("Replied", "ack to read.request"),
        ("Asked", "taken.request"), ("Stray", "read.place"), ("Unanswered", "taken.request"),
    ]  # fmt: skip
    assert heard(loader, [loader.ReadRequest(node=3), loader.Nack(node=3, reason=1), place]) == [
        ("Asked", "read.request"), ("Replied", "nack to read.request"), ("Stray", "read.place"),
    ]  # fmt: skip
    again = [loader.ReadRequest(node=3), ack, place, loader.Busy(node=3), place, ack]
    assert [kind for kind, _ in heard(loader, again)] == ["Asked", "Replied"] * 3


def test_a_monitor_reports_a_missing_answer_only_when_one_is_due(loader: ModuleType) -> None:
    asked = loader.ReadRequest(node=3)
    assert heard(loader, [asked, loader.Ack(node=3)]) == [
        ("Asked", "read.request"), ("Replied", "ack to read.request"),
    ]  # fmt: skip
    events = heard(loader, [asked, loader.Ack(node=3), loader.ReadPlace(node=3, start=1)])
    assert events[-1][0] == Unanswered.__name__
    assert events[-2] == (Asked.__name__, "read.place")


@pytest.mark.parametrize("seed", range(4))
def test_no_wrong_answers_on_a_noisy_line(loader: ModuleType, seed: int) -> None:
    faults = FaultPlan(
        drop=0.01, flip=0.02, truncate=0.01, delay=0.02, late=0.01, duplicate=0.02, noise=0.02, seed=seed
    )
    master, _ = bus(loader, Memory(loader), faults=faults)
    right = 0
    for number in range(150):
        start, count = number * 77 + seed, number % 16 + 1
        try:
            reply = master.transact(reading(loader, start, count))
        except LinkError:
            continue
        assert [type(each).__name__ for each in reply.response] == ["Ack", "Ack", "Ack", "ReadData"]
        assert reply.response[-1].data == data_of(start, count)
        right += 1
    assert right > 120
