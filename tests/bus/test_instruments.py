"""An instrument with commands of text: a master and slaves talk in memory."""

from __future__ import annotations

import importlib
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


def test_a_node_of_the_schema_alone_answers() -> None:
    with join(meter.Device, GenericNode(codec, 0)) as pair:
        answer = pair.master.identify()
        assert (answer.maker, answer.serial) == (" ", "")
        assert pair.master.measure_ac().mode is codec.Mode.VOLTAGE
