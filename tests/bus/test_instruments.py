"""An instrument with commands of text: a master and slaves talk in memory."""

from __future__ import annotations

import importlib
import itertools
from typing import Any

import pytest

from qlinkgen.errors import NoReply
from qlinkgen.sim.generic import GenericNode
from qlinkgen.sim.joining import join
from tests.bus.wires import PACKAGE, of_text
from tests.whole.test_text_ids import METER

meter: Any = of_text(METER)
codec: Any = importlib.import_module(f"{PACKAGE}.meter")


class Voltmeter(meter.SlaveHandlers):  # type: ignore[misc]  # Any: generated at run time
    """A slave that keeps what it is told."""

    def __init__(self) -> None:
        super().__init__(0)
        self.told: list[Any] = []

    def measure(self, request: Any, now: float) -> Any:
        return codec.MeasureResponse(value=-1.25e-3 * (request.channel or 1))

    def measure_ac(self, request: Any, now: float) -> Any:
        return codec.MeasureAcResponse(value=1.5, mode=codec.Mode.CURRENT)

    def configure(self, request: Any, now: float) -> None:
        self.told.append((request.mode, request.range))

    def label(self, request: Any, now: float) -> None:
        self.told.append(request.text)


def test_a_master_asks_and_tells() -> None:
    slave, heard = Voltmeter(), bytearray()
    with join(meter.Device, slave) as pair:
        pair.wire.taps.append(lambda _now, _sender, piece: heard.extend(piece))
        device = pair.master
        assert device.measure(channel=2).value == -2.5e-3
        assert device.measure().value == -1.25e-3
        answer = device.measure_ac(channel=7)
        assert (answer.value, answer.mode) == (1.5, codec.Mode.CURRENT)
        device.configure(mode=codec.Mode.CURRENT, range=10)
        device.label(text="a, b")
        assert device.measure().value == -1.25e-3
        with pytest.raises(NoReply):
            device.identify()
    assert slave.told == [(codec.Mode.CURRENT, 10), "a, b"]
    assert bytes(heard).startswith(b"MEAS:VOLT? 2\n-2.5E-03\nMEAS:VOLT?\n-1.25E-03\n")


def test_a_slave_takes_commands_in_any_case() -> None:
    slave = Voltmeter()
    with join(meter.Device, slave) as pair:
        engine = pair.others[0]
        engine.receive(b"conf curr 12\nCoNf VOLT 3\ndisp:text Hi\nmeas:volt? 4\n", 0.0)
    assert slave.told == [(codec.Mode.CURRENT, 12), (codec.Mode.VOLTAGE, 3), "Hi"]


def test_a_handler_that_returns_no_message() -> None:
    slave = Voltmeter()
    slave.measure = lambda request, now: "12 V"  # type: ignore[method-assign]
    with (
        join(meter.Device, slave) as pair,
        pytest.raises(TypeError, match=r"measure.request returned '12 V'.*return MeasureResponse"),
    ):
        pair.master.measure()


def test_a_node_of_the_schema_alone_answers() -> None:
    with join(meter.Device, GenericNode(codec, 0)) as pair:
        answer = pair.master.identify()
        assert (answer.maker, answer.serial) == (" ", "")
        assert pair.master.measure_ac().mode is codec.Mode.VOLTAGE


SCALE = """\
qlinkgen: 1
protocol: {name: balance, title: A balance, revision: "1", source: Manual}
frame:
  parts:
    command: {role: message, type: "text[1..4]"}
    data: {role: payload, size: 0..20}
    end: {role: terminator, value: 0D 0A}
bus: {kind: master_slave, baud: 9600, response_within: 1 s}
defaults: {repeat: safe, addressing: none}
commands:
  weigh:
    id: SIR
    request: {}
    response: {value: {type: u16, as: "decimal[5]"}}
    many: {until: cancel, within: 2 s}
  cancel: {id: "@", request: {}, response: {}}
  read: {id: S, request: {}, response: {value: {type: u16, as: "decimal[5]"}}}
"""


def test_answers_without_an_end_are_left_early() -> None:
    balance: Any = of_text(SCALE)
    values: Any = importlib.import_module(f"{PACKAGE}.balance")

    class Balance(balance.SlaveHandlers):  # type: ignore[misc]  # Any: generated at run time
        """A slave that sends weights as fast as it can."""

        def weigh(self, request: Any, now: float) -> Any:
            return (values.WeighResponse(value=each) for each in range(1000))

        def cancel(self, request: Any, now: float) -> Any:
            return values.CancelResponse()

        def read(self, request: Any, now: float) -> Any:
            return values.ReadResponse(value=7)

    with join(balance.Device, Balance(0)) as pair:
        weights = pair.master.weigh()
        assert [next(weights).value for _ in range(3)] == [0, 1, 2]
        weights.close()
        assert pair.master.read().value == 7
        assert [each.outcome.value for each in itertools.islice(pair.master.poll({"read": 1.0}), 2)] == [7, 7]
        for key, text in (
            ("raed", "unknown command 'raed'; commands are weigh, cancel, read"),
            ((None, "raed"), "unknown command 'raed'"),
            ((3, "read"), r"\(3, 'read'\) names a node, but frames of read have no address; give 'read'"),
        ):
            with pytest.raises(ValueError, match=text):
                pair.master.poll({key: 1.0})
