"""The device of a host on a port."""

from __future__ import annotations

from collections.abc import Callable
from typing import Self, Unpack

from qlinkgen.bus.making import open_line
from qlinkgen.bus.options import DeviceOptions, Parity, StopBits
from qlinkgen.bus.slaves import Serving
from qlinkgen.link.device import DeviceCodec, DeviceEngine, Handlers
from qlinkgen.link.events import Frame
from qlinkgen.transport.opening import closing_on_error
from qlinkgen.transport.port import Port


class DeviceSlave(Serving):
    """The device of a host on a port, which is an object with a method for each command.

    Attributes:
        codec: the generated module of the protocol.
        engines: its engine, with its counters.
    """

    codec: DeviceCodec
    engines: list[DeviceEngine]

    def __init__(
        self,
        port: Port,
        handlers: Handlers,
        *,
        turnaround: float = 0.0,
        forgets: float = 0.0,
        on_frame: Callable[[Frame], None] | None = None,
    ) -> None:
        """Take ownership of a port; closing the device closes it. The options are in `qlinkgen.bus.options`.

        Raises:
            ValueError: an option is out of range.
        """
        self.engines = [DeviceEngine(self.codec, handlers, forgets=forgets, turnaround=turnaround)]
        self._begin(port, on_frame)

    @classmethod
    def open(
        cls,
        name: str,
        handlers: Handlers,
        *,
        baud: int | None = None,
        parity: Parity = "none",
        stop_bits: StopBits = 1,
        **options: Unpack[DeviceOptions],
    ) -> Self:
        """Open a device name or a URL of pyserial; the arguments are those of `Bus.open`."""
        opened = open_line(cls.codec, name, baud=baud, parity=parity, stop_bits=stop_bits, reopen=False)
        with closing_on_error(opened) as port:
            return cls(port, handlers, **options)

    @classmethod
    def serve(
        cls,
        name: str,
        handlers: Handlers,
        stop: Callable[[], bool] = lambda: False,
        *,
        baud: int | None = None,
        parity: Parity = "none",
        stop_bits: StopBits = 1,
        **options: Unpack[DeviceOptions],
    ) -> None:
        """Open a port and answer there until `stop()` is true, by default as long as the port exists.

        Raises:
            PortLost: the port was lost.
        """
        with cls.open(name, handlers, baud=baud, parity=parity, stop_bits=stop_bits, **options) as device:
            device.run(stop)
