"""Wrong arguments, lost ports, Ctrl-C: a clear error, nothing sent, and a usable bus."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from qlinkgen.codecs import qlink
from qlinkgen.errors import HexFileError, PortLost
from qlinkgen.link import SlaveEngine
from qlinkgen.protocols.qlink import Bus
from qlinkgen.sim import VirtualPort, Wire
from qlinkgen.transport import memory_pair
from tests.qlink.behaviour_rig import CLEAN, Probe, Rig, Setting, make_rig
from tests.qlink.test_behaviour_node import hex_text

#: Each with a word that the error must contain.
WRONG: list[tuple[str, Callable[[Bus], object], str]] = [
    ("node 17", lambda bus: bus.motor_position(17), "node"),
    ("node -1", lambda bus: bus.node_stop(-1), "node"),
    ("node 0", lambda bus: bus.motor_position(0), "node"),
    ("node text", lambda bus: bus.read("3", size=1), "node"),  # type: ignore[arg-type]
    ("node None", lambda bus: bus.clear_fifo(None), "node"),  # type: ignore[arg-type]
    ("node() 0", lambda bus: bus.node(0), "node"),
    ("node() 17", lambda bus: bus.node(17), "node"),
    ("node() text", lambda bus: bus.node("x"), "node"),  # type: ignore[arg-type]
    ("setup number 0", lambda bus: bus.node_setup(1, node_number=0), "node_number"),
    ("setup number 17", lambda bus: bus.node_setup(1, node_number=17), "node_number"),
    ("setup t1", lambda bus: bus.node_setup(1, t1_delay=25.6), "t1_delay"),
    ("setup t1 nan", lambda bus: bus.node_setup(1, t1_delay=float("nan")), "t1_delay"),
    ("setup t2", lambda bus: bus.node_setup(1, t2_delay=-0.1), "t2_delay"),
    ("setup t2 inf", lambda bus: bus.node_setup(1, t2_delay=float("inf")), "t2_delay"),
    ("setup type", lambda bus: bus.node_setup(1, position_type=256), "position_type"),
    ("sync counter", lambda bus: bus.node_sync(counter=256), "counter"),
    ("sync counter text", lambda bus: bus.node_sync(counter="1"), "counter"),  # type: ignore[arg-type]
    ("sync interval 0", lambda bus: bus.sync(0), "interval"),
    ("sync interval nan", lambda bus: bus.sync(float("nan"), count=1), "interval"),
    ("sync count", lambda bus: bus.sync(0.1, count=-1), "count"),
    ("piece counter", lambda bus: bus.node_program_load(1, counter=-1), "counter"),
    ("piece of 26", lambda bus: bus.node_program_load(1, program_data=bytes(26)), "program_data"),
    ("piece text", lambda bus: bus.node_program_load(1, program_data="x"), "program_data"),  # type: ignore[arg-type]
    ("motor nothing", lambda bus: bus.motor_request(1, motor_data=b""), "motor_data"),
    ("motor 27", lambda bus: bus.motor_request(1, motor_data=bytes(27)), "motor_data"),
    ("complete 27", lambda bus: bus.complete_motor_request(1, bytes(27)), "motor_data"),
    ("complete timeout", lambda bus: bus.complete_motor_request(1, b"x", timeout=-1), "timeout"),
    ("complete interval", lambda bus: bus.complete_motor_request(1, b"x", poll_interval=-1), "poll_interval"),
    ("motion 13", lambda bus: bus.motion(1, segments=[0] * 13), "segments"),
    ("motion word", lambda bus: bus.motion(1, segments=[65536]), "segments"),
    ("motion text", lambda bus: bus.motion(1, segments=["x"]), "segments"),  # type: ignore[list-item]
    ("motion outputs", lambda bus: bus.motion(1, outputs=256), "outputs"),
    ("motion counter", lambda bus: bus.motion(1, counter=256), "counter"),
    ("motion node", lambda bus: bus.motion(0, segments=[1]), "node"),
    ("preset", lambda bus: bus.preset_motor_position(1, position=2**31), "position"),
    ("preset float", lambda bus: bus.preset_motor_position(1, position=1.5), "position"),  # type: ignore[arg-type]
    ("read 0", lambda bus: bus.read(1, size=0), "size"),
    ("read 27", lambda bus: bus.read(1, size=27), "size"),
    ("read offset", lambda bus: bus.read(1, size=1, offset=256), "offset"),
    ("write nothing", lambda bus: bus.write(1, data=b""), "data"),
    ("write 26", lambda bus: bus.write(1, data=bytes(26)), "data"),
    ("write_read", lambda bus: bus.write_read(1, outputs=1 << 24), "outputs"),
    ("set_outputs", lambda bus: bus.set_outputs(1, mask=-1), "mask"),
    ("clear_outputs", lambda bus: bus.clear_outputs(1, mask=1 << 24), "mask"),
    ("loop_back 26", lambda bus: bus.loop_back(1, data=bytes(26)), "data"),
    ("load nothing", lambda bus: bus.load(1, b""), "empty"),
    ("load piece 0", lambda bus: bus.load(1, b":00000001FF", piece=0), "piece"),
    ("load piece 26", lambda bus: bus.load(1, b":00000001FF", piece=26), "piece"),
    ("load node", lambda bus: bus.load(17, b":00000001FF"), "node"),
    ("load patience", lambda bus: bus.load(1, b":00000001FF", patience=-1), "patience"),
    ("scan 17", lambda bus: bus.scan([17]), "node"),
    ("scan text", lambda bus: bus.scan("1"), "node"),  # type: ignore[arg-type]
    ("status 17", lambda bus: bus.status([17]), "node"),
    ("stream node", lambda bus: list(bus.stream_motion({17: [1]})), "node"),
    ("stream broadcast", lambda bus: list(bus.stream_motion({0: [1]})), "node"),
    ("stream outputs", lambda bus: list(bus.stream_motion({1: [1]}, outputs=256)), "outputs"),
    ("stream patience", lambda bus: list(bus.stream_motion({1: [1]}, patience=-1)), "patience"),
    ("stream pause", lambda bus: list(bus.stream_motion({1: [1]}, full_pause=-1)), "full_pause"),
    ("attempts 0", lambda bus: bus.transact(qlink.NodeInfoRequest(node=1), attempts=0), "attempts"),
    ("no request", lambda bus: bus.transact("node_info"), "request"),  # type: ignore[arg-type]
    ("a response", lambda bus: bus.transact(qlink.NodeInfoResponse(node=1)), "request"),
]


@pytest.fixture(params=[CLEAN[0], CLEAN[3]], ids=["blocking", "asyncio"])
def rig(request: pytest.FixtureRequest) -> Iterator[Rig]:
    setting: Setting = request.param
    with make_rig(setting, Probe()) as rig:
        rig.bus.motion(1)
        yield rig


@pytest.mark.parametrize(
    ("call", "word"), [(call, word) for _, call, word in WRONG], ids=[name for name, *_ in WRONG]
)
def test_a_wrong_argument_is_refused_before_a_byte_is_sent(
    rig: Rig, call: Callable[[Bus], object], word: str
) -> None:
    written: list[bytes] = []
    rig.wire.taps.append(lambda _now, _source, data: written.append(data))
    before = rig.bus.engine.total.requests
    with pytest.raises((ValueError, TypeError), match=word):
        call(rig.bus)
    rig.sleep(0.1)
    assert written == []
    assert rig.bus.engine.total.requests == before
    rig.bus.motion(1, segments=[7])
    assert rig.node.words == [7]


def test_a_wrong_word_in_the_middle_of_a_stream_stops_it(rig: Rig) -> None:
    with pytest.raises(ValueError, match="segments"):
        list(rig.bus.stream_motion({1: [*range(20), -1, 5]}))
    assert rig.node.words == list(range(len(rig.node.words)))
    queued = len(rig.node.words)
    rig.bus.motion(1, segments=[99])
    assert rig.node.words[queued:] == [99]


def test_an_error_of_the_iterable_stops_the_stream(rig: Rig) -> None:
    def words() -> Iterator[int]:
        yield from range(20)
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        list(rig.bus.stream_motion({1: words()}))
    rig.bus.motion(1, segments=[99])
    assert rig.node.words[-1] == 99


@pytest.mark.parametrize(
    ("text", "word"),
    [
        (None, "No such file"),
        (b"", "empty"),
        (b"no hex at all\n", "':'"),
        (b":00000001FE\n", "checksum"),
        (b":0100000001FE\n", "end record"),
        (bytes(range(256)), "binary"),
    ],
)
def test_a_bad_file_is_refused_before_a_byte_is_sent(
    rig: Rig, tmp_path: Path, text: bytes | None, word: str
) -> None:
    file = tmp_path / "program.hex"
    if text is not None:
        file.write_bytes(text)
    before = rig.bus.engine.total.requests
    with pytest.raises(HexFileError, match=word):
        rig.bus.load(1, file)
    assert rig.bus.engine.total.requests == before


def test_bad_options_of_a_bus() -> None:
    port = VirtualPort(Wire(baud=115200))
    for options, word in (
        ({"attempts": 0}, "attempts"),
        ({"echo": "loud"}, "echo"),
        ({"slack": -1.0}, "slack"),
        ({"slack": float("nan")}, "slack"),
    ):
        with pytest.raises(ValueError, match=word):
            Bus(port, **options)


class TestPortsThatGoAway:
    def test_in_a_call(self) -> None:
        near, far = memory_pair()
        bus = Bus(near, slack=0.05, echo="none")
        far.close()
        for _ in range(2):
            with pytest.raises(PortLost, match="lost"):
                bus.motor_position(1)
        assert not bus.engine.busy
        bus.close()

    def test_in_the_middle_of_a_load(self, monkeypatch: pytest.MonkeyPatch) -> None:
        with make_rig(CLEAN[0], Probe()) as rig:
            fail_at(rig.bus.port, monkeypatch, 5, PortLost("the plug is out", port="virtual"))
            with pytest.raises(PortLost, match="plug"):
                rig.bus.load(1, hex_text(3))
            assert not rig.bus.engine.busy
            rig.bus.load(1, hex_text(3))
            assert rig.node.program is not None

    def test_a_closed_bus_says_so(self) -> None:
        with make_rig(CLEAN[0], Probe()) as rig:
            rig.bus.close()
            with pytest.raises(PortLost, match="closed"):
                rig.bus.motor_position(1)


def fail_at(port: Any, monkeypatch: pytest.MonkeyPatch, at: int, error: BaseException) -> None:
    """Make the read that waits for the answer to the `at`th request fail, once."""
    write, read = port.write, port.read
    sent = 0

    def counting(data: bytes) -> None:
        nonlocal sent
        sent += 1
        write(data)

    def failing(timeout: float) -> bytes:
        nonlocal sent
        if sent >= at and timeout > 0:
            sent = -(10**9)
            raise error
        return bytes(read(timeout))

    monkeypatch.setattr(port, "write", counting)
    monkeypatch.setattr(port, "read", failing)


class TestCtrlC:
    @pytest.mark.parametrize("at", range(1, 8))
    def test_in_the_middle_of_a_load(self, monkeypatch: pytest.MonkeyPatch, at: int) -> None:
        with make_rig(CLEAN[0], Probe()) as rig:
            fail_at(rig.bus.port, monkeypatch, at, KeyboardInterrupt())
            with pytest.raises(KeyboardInterrupt):
                rig.bus.load(1, hex_text(3))
            assert not rig.bus.engine.busy
            assert rig.bus.motor_position(1).position == 0, "a late answer is not the answer to this request"
            rig.bus.load(1, hex_text(3))
            image = rig.node.program
            assert image is not None
            assert image.text == hex_text(3)

    @pytest.mark.parametrize("at", range(1, 8))
    def test_in_the_middle_of_a_stream(self, monkeypatch: pytest.MonkeyPatch, at: int) -> None:
        with make_rig(CLEAN[0], Probe(started=True, rate=1e5)) as rig:
            fail_at(rig.bus.port, monkeypatch, at, KeyboardInterrupt())
            with pytest.raises(KeyboardInterrupt):
                list(rig.bus.stream_motion({1: range(200)}))
            pending = rig.bus.state.motions[1].pending
            queued = rig.node.words
            assert queued == list(range(len(queued)))
            assert pending is not None
            rig.bus.motion(1, segments=[999])
            assert rig.node.words == [*range(len(rig.node.words) - 1), 999], "none is lost, none is doubled"
            assert rig.node.statistics.jumps == 0

    def test_in_the_middle_of_a_call(self, monkeypatch: pytest.MonkeyPatch) -> None:
        wire = Wire(baud=115200)
        node = Probe()
        wire.attach(SlaveEngine(qlink, node, turnaround=0.001))
        bus = Bus(VirtualPort(wire), echo="none", slack=0.01)
        fail_at(bus.port, monkeypatch, 1, KeyboardInterrupt())
        with pytest.raises(KeyboardInterrupt):
            bus.read(1, size=1)
        node.inputs = 0xFE
        assert bytes(bus.read(1, size=1).data) == b"\xfe", (
            "the first answer does not answer the second question"
        )
        assert bus.engine.total.strays == 1
