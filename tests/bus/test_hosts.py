"""A host and its device, of a schema: what they do beyond the behaviours that every bus shows."""

from __future__ import annotations

import asyncio
import contextlib
import importlib
import itertools
import logging
from collections.abc import AsyncIterator
from typing import Any

import pytest

from qlinkgen.errors import IllegalCommand, NoReply
from qlinkgen.link.events import Frame
from qlinkgen.link.host_events import InStep
from qlinkgen.pytest_plugin import BusPairs
from qlinkgen.sim import VirtualPort, Wire
from tests.bus.wires import PACKAGE, of_text

PUMP = """\
qlinkgen: 1
protocol: {name: pump, title: A pump, revision: "1", source: Manual}
frame:
  packet:
    code: {role: message, type: u8}
    words: {role: payload, size: 0..4}
    sum: {role: checksum, type: u16, algorithm: sum16, words: 2, rejected: 0}
bus:
  kind: host
  baud: 19200
  resync: {command: status, fill: 0xFF}
  select: {attribute: channel, values: [own], commands: {first: 1, second: 2}, lost_by: [reset]}
attributes: {channel: {values: [own, none]}}
defaults: {repeat: safe, request: {}, response: {}, attributes: {channel: none}}
commands:
  status: {id: 0x10, response: {status: u16}}
  first: {id: 0x11}
  second: {id: 0x12}
  reset: {id: 0x13, repeat: unsafe}
  set_rate: {id: 0x14, request: {rate: u16}, attributes: {channel: own}}
  get_rate: {id: 0x15, response: {rate: u16}, attributes: {channel: own}}
  beep: {id: 0x16, response: none}
  drain: {id: 0x17}
"""
pump: Any = of_text(PUMP)
codec: Any = importlib.import_module(f"{PACKAGE}.pump")


class Pump(pump.SlaveHandlers):  # type: ignore[misc]  # Any: generated at run time
    """A pump with two channels, which cannot drain."""

    def __init__(self) -> None:
        self.rates = {1: 10, 2: 20}
        self.channel = 1
        self.beeps = 0

    def status(self, request: Any, now: float) -> Any:
        return codec.StatusResponse(status=7)

    def first(self, request: Any, now: float) -> Any:
        self.channel = 1
        return codec.FirstResponse()

    def second(self, request: Any, now: float) -> Any:
        self.channel = 2
        return codec.SecondResponse()

    def reset(self, request: Any, now: float) -> Any:
        self.channel = 1
        return codec.ResetResponse()

    def set_rate(self, request: Any, now: float) -> Any:
        self.rates[self.channel] = request.rate
        return codec.SetRateResponse()

    def get_rate(self, request: Any, now: float) -> Any:
        return codec.GetRateResponse(rate=self.rates[self.channel])

    def beep(self, request: Any, now: float) -> None:
        self.beeps += 1


def test_commands_act_on_what_is_selected(bus_pair: BusPairs) -> None:
    handlers = Pump()
    frames: list[Frame] = []
    pair = bus_pair(f"{PACKAGE}.pump", handlers, on_frame=frames.append)
    device = pair.master
    assert device.get_rate(2).rate == 20
    device.channel(2).set_rate(rate=21)
    device.beep()
    device.reset()
    assert device.channel(2).get_rate().rate == 21
    assert (handlers.rates, handlers.beeps) == ({1: 10, 2: 21}, 1)
    sent = [each.message.NAME.removesuffix(".request") for each in frames if each.sent and each.message]
    assert sent == ["second", "get_rate", "set_rate", "beep", "reset", "second", "get_rate"]
    assert [each.data.hex() for each in frames[:4]] == ["12", "0012", "15", "00140029"]
    with pytest.raises(ValueError, match="channel must be 1 or 2, not 3"):
        device.channel(3)
    with pytest.raises(ValueError, match="checksum: unknown command 'get_rat'; did you mean get_rate"):
        bus_pair(f"{PACKAGE}.pump", Pump(), checksum=["get_rat"])


def test_what_the_device_does_not_know_it_rejects(bus_pair: BusPairs) -> None:
    pair = bus_pair(f"{PACKAGE}.pump", Pump())
    with pytest.raises(IllegalCommand):
        pair.master.drain()
    assert pair.master.status().status == 7
    (engine,) = pair.others
    engine.receive(b"\x77", 0.0)
    assert engine.bytes_to_send(0.0) == b"\0\0"
    handlers = Pump()
    handlers.status = lambda request, now: "7"  # type: ignore[method-assign]
    with pytest.raises(TypeError, match=r"status.request returned '7', which is not its response"):
        bus_pair(f"{PACKAGE}.pump", handlers).master.status()


def test_a_device_that_rejects_nothing_is_silent(bus_pair: BusPairs) -> None:
    """Where the schema has no check value for that; an answer without bytes is not a rejection."""
    mute: Any = of_text(PUMP.replace(", rejected: 0", "").replace("name: pump", "name: mute"))
    pair = bus_pair(mute.Device, mute.SlaveHandlers(), attempts=1)
    with pytest.raises(NoReply):
        pair.master.drain()
    assert pair.others[0].counters.illegal == 1


def test_a_packet_that_is_cut_is_ended_and_the_loss_is_told(
    bus_pair: BusPairs, caplog: pytest.LogCaptureFixture
) -> None:
    logger = logging.getLogger("pump")
    handlers, events = Pump(), list[Any]()
    pair = bus_pair(f"{PACKAGE}.pump", handlers, logger=logger, on_event=events.append)
    (engine,) = pair.others
    engine.receive(b"\x14\0", 0.0)  # the beginning of set_rate, as by noise
    with caplog.at_level(logging.DEBUG, "pump"):
        assert pair.master.get_rate(2).rate == 20
    assert any(type(each) is InStep for each in events)
    told = [record.__dict__["event"] for record in caplog.records]
    assert {"OutOfStep", "Filled", "InStep", "Answered"} <= set(told)
    assert handlers.rates[2] == 20
    assert pair.master.engine.total.as_dict()["in_step"] == 1


def test_polling_selects_and_health_is_that_of_each(bus_pair: BusPairs) -> None:
    with contextlib.closing(
        bus_pair(f"{PACKAGE}.pump", Pump()).master.poll({(1, "get_rate"): 0.5, (2, "get_rate"): 0.5})
    ) as polled:
        found = [(each.node, each.outcome.rate) for each in itertools.islice(polled, 4)]
    assert sorted(found) == [(1, 10), (1, 10), (2, 20), (2, 20)]
    master = bus_pair(f"{PACKAGE}.pump", Pump(), asynchronous=True).master

    async def run() -> list[Any]:
        async with contextlib.aclosing(master.poll({"status": 1.0})) as each:
            answers: AsyncIterator[Any] = each
            return [await anext(answers), await anext(answers)]

    assert [each.outcome.status for each in asyncio.run(run())] == [7, 7]


def test_a_device_on_a_port_answers_in_a_thread_and_tells_of_packets() -> None:
    frames: list[Frame] = []
    port = VirtualPort(Wire(baud=19200))
    with pump.Slave(port, Pump(), on_frame=frames.append) as device:
        (engine,) = device.engines
        engine.receive(b"\x10", 0.0)
        stops = iter((False, True))
        device.run(lambda: next(stops))
        assert engine.counters.packets == 1
    assert [(each.sent, each.data.hex()) for each in frames] == [(False, "10"), (True, "00070017")]


def test_a_cut_packet_is_forgotten_after_a_silence() -> None:
    port = VirtualPort(Wire(baud=19200))
    with pump.Slave(port, Pump(), forgets=0.1) as device:
        (engine,) = device.engines
        engine.receive(b"\x14\0", 0.0)
        engine.receive(b"\x10", 0.2)
        assert engine.bytes_to_send(0.2).hex() == "00070017"
        assert engine.counters.forgotten == 1
    with pytest.raises(ValueError, match="forgets must be 0 s or more and finite"):
        pump.Slave(port, Pump(), forgets=-1.0)
