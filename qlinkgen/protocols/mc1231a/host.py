"""The host of a chip set.

Derived from `aio.py` by `python -m tests.unasync`: change that one, and run it.
"""

from __future__ import annotations

from typing import Self, TypeVar, Unpack

from qlinkgen.bus.host import Selected
from qlinkgen.bus.making import open_line
from qlinkgen.bus.options import HostOptions
from qlinkgen.codecs import mc1231a
from qlinkgen.codecs.mc1231a_bus import AxisCalls, Device
from qlinkgen.link.codec import Framed
from qlinkgen.protocols.mc1231a import updating
from qlinkgen.protocols.mc1231a.usage import Usage
from qlinkgen.transport.opening import closing_on_error
from qlinkgen.transport.port import Port

R = TypeVar("R")


class Host(Device):
    """The host of a chip set, for any number of threads.

    Every command of the table is a method; those that act on the current axis take the axis as their first
    argument, and are methods of `axis(n)` without it. The host tracks the current axis: set_1 or set_2 is
    sent only if needed. Methods return the response and raise LinkError (NoReply, BadReply, IllegalCommand),
    PortLost, or, before anything is sent, the EncodeError of `qlinkgen.codecs.mc1231a`.

    Example:
        >>> with Host.open("/dev/ttyUSB0", baud=57600) as host:  # doctest: +SKIP
        ...     host.axis(2).set_pos(value=0x02345678)
        ...     host.axis(2).update(check=True)

    Attributes:
        command_errors: update and multi_update check for the command error by default.
    """

    def __init__(self, port: Port, *, command_errors: bool = False, **options: Unpack[HostOptions]) -> None:
        """Take ownership of a port; closing the host closes it.

        Args:
            port: the port of the chip set.
            command_errors: update and multi_update also read the status word, and raise CommandError.
            options: those of any host, in `qlinkgen.bus.options`.
        """
        super().__init__(port, **options)
        self.command_errors = command_errors
        self.usage = Usage()

    @classmethod
    def open(  # type: ignore[override]  # the sources state no speed
        cls, name: str, *, baud: int, command_errors: bool = False, **options: Unpack[HostOptions]
    ) -> Self:
        """Open a device name or a URL of pyserial; the rest as for the class.

        Raises:
            PortMissing: the port does not exist.
            PortBusy: another program uses it, or this user lacks the permission.
        """
        opened = open_line(mc1231a, name, baud=baud, parity="none", stop_bits=1, reopen=False)
        with closing_on_error(opened) as port:
            return cls(port, command_errors=command_errors, **options)

    def axis(self, number: int) -> Axis:  # type: ignore[override]  # with its own update
        """Return one axis, 1 or 2."""
        return Axis(self, number)

    def ask(self, request: Framed, response: type[R], axis: int | None = None) -> R:
        """Send a packet, for an axis if one is given, and return its answer."""
        self.usage.note(request)
        return super().ask(request, response, axis)

    def raise_command_error(self, axis: int) -> int:
        """Read the status word of an axis and return it.

        Raises:
            CommandError: its command error bit is set.
        """
        return self.run(updating.raise_command_error(axis))

    def update(self, axis: int, *, check: bool | None = None) -> mc1231a.UpdateResponse:
        """Activate all buffered values of an axis.

        Args:
            axis: 1 or 2.
            check: then read the status word, and raise CommandError on a command error, of this update or an
                earlier one; None: the default of the host.
        """
        return self.run(updating.update(axis, check=self.command_errors if check is None else check))

    def multi_update(self, *, axes: int = 0, check: bool | None = None) -> mc1231a.MultiUpdateResponse:
        """Update several axes simultaneously; the mask is inferred from the sources, not confirmed.

        Args:
            axes: masks of Axes; bit 0 is axis 1.
            check: as for `update`, of each of these axes.
        """
        return self.run(updating.multi_update(axes, check=self.command_errors if check is None else check))


class Axis(Selected[Host], AxisCalls):
    """One axis: every command that acts on the current axis, without the axis argument.

    Attributes:
        host: the host.
        number: 1 or 2.
    """

    def ask(self, request: Framed, response: type[R]) -> R:
        """Send a packet for this axis and return its answer."""
        self.host.usage.note(request)
        return Device.ask(self.host, request, response, self.number)

    def raise_command_error(self) -> int:
        """As `Host.raise_command_error`."""
        return self.host.raise_command_error(self.number)

    def update(self, *, check: bool | None = None) -> mc1231a.UpdateResponse:
        """As `Host.update`."""
        return self.host.update(self.number, check=check)
