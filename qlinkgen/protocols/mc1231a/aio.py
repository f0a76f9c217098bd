"""The host of a chip set for asyncio; `qlinkgen.protocols.mc1231a.host` is derived from it."""

from __future__ import annotations

from typing import Self, TypeVar, Unpack

from qlinkgen.bus.host_aio import AsyncSelected
from qlinkgen.bus.making import open_line
from qlinkgen.bus.options import HostOptions
from qlinkgen.codecs import mc1231a
from qlinkgen.codecs.mc1231a_bus import AsyncAxisCalls, AsyncDevice
from qlinkgen.link.codec import Framed
from qlinkgen.protocols.mc1231a import updating
from qlinkgen.protocols.mc1231a.usage import Usage
from qlinkgen.transport.opening import closing_on_error
from qlinkgen.transport.port import Port

R = TypeVar("R")


class AsyncHost(AsyncDevice):
    """The host of a chip set, for any number of tasks of one event loop.

    Every command of the table is a method; those that act on the current axis take the axis as their first
    argument, and are methods of `axis(n)` without it. The host tracks the current axis: set_1 or set_2 is
    sent only if needed. Methods return the response and raise LinkError (NoReply, BadReply, IllegalCommand),
    PortLost, or, before anything is sent, the EncodeError of `qlinkgen.codecs.mc1231a`.

    Example:
        >>> async with AsyncHost.open("/dev/ttyUSB0", baud=57600) as host:  # doctest: +SKIP
        ...     await host.axis(2).set_pos(value=0x02345678)
        ...     await host.axis(2).update(check=True)

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

    def axis(self, number: int) -> AsyncAxis:  # type: ignore[override]  # with its own update
        """Return one axis, 1 or 2."""
        return AsyncAxis(self, number)

    async def ask(self, request: Framed, response: type[R], axis: int | None = None) -> R:
        """Send a packet, for an axis if one is given, and return its answer."""
        self.usage.note(request)
        return await super().ask(request, response, axis)

    async def raise_command_error(self, axis: int) -> int:
        """Read the status word of an axis and return it.

        Raises:
            CommandError: its command error bit is set.
        """
        return await self.run(updating.raise_command_error(axis))

    async def update(self, axis: int, *, check: bool | None = None) -> mc1231a.UpdateResponse:
        """Activate all buffered values of an axis.

        Args:
            axis: 1 or 2.
            check: then read the status word, and raise CommandError on a command error, of this update or an
                earlier one; None: the default of the host.
        """
        return await self.run(updating.update(axis, check=self.command_errors if check is None else check))

    async def multi_update(self, *, axes: int = 0, check: bool | None = None) -> mc1231a.MultiUpdateResponse:
        """Update several axes simultaneously; the mask is inferred from the sources, not confirmed.

        Args:
            axes: masks of Axes; bit 0 is axis 1.
            check: as for `update`, of each of these axes.
        """
        return await self.run(
            updating.multi_update(axes, check=self.command_errors if check is None else check)
        )


class AsyncAxis(AsyncSelected[AsyncHost], AsyncAxisCalls):
    """One axis: every command that acts on the current axis, without the axis argument.

    Attributes:
        host: the host.
        number: 1 or 2.
    """

    async def ask(self, request: Framed, response: type[R]) -> R:
        """Send a packet for this axis and return its answer."""
        self.host.usage.note(request)
        return await AsyncDevice.ask(self.host, request, response, self.number)

    async def raise_command_error(self) -> int:
        """As `AsyncHost.raise_command_error`."""
        return await self.host.raise_command_error(self.number)

    async def update(self, *, check: bool | None = None) -> mc1231a.UpdateResponse:
        """As `AsyncHost.update`."""
        return await self.host.update(self.number, check=check)
