"""The asyncio host of a chip set: the same methods as coroutines."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from qlinkgen.codecs import mc1231a
from qlinkgen.codecs.mc1231a_bus import AsyncAxisCalls, AsyncHostCalls
from qlinkgen.link.events import Event
from qlinkgen.link.host import HostEngine
from qlinkgen.protocols.mc1231a import updating
from qlinkgen.protocols.mc1231a.facts import SELECT, check_axis
from qlinkgen.protocols.mc1231a.usage import Checksum, Usage, make_engine, packet
from qlinkgen.transport.aio import AsyncMaster
from qlinkgen.transport.opening import open_port
from qlinkgen.transport.port import Port

R = TypeVar("R", bound=mc1231a.Message)


class AsyncHost(AsyncMaster, AsyncHostCalls):
    """The host of a chip set, for any number of tasks of one event loop. Otherwise like `Host`.

    Example:
        >>> async with AsyncHost.open("/dev/ttyUSB0", baud=57600) as host:  # doctest: +SKIP
        ...     await host.axis(2).set_pos(value=0x02345678)
        ...     await host.axis(2).update(check=True)

    Attributes:
        command_errors: update and multi_update check for the command error by default.
    """

    engine: HostEngine

    def __init__(
        self,
        port: Port,
        *,
        checksum: Checksum = "always",
        attempts: int = 3,
        command_errors: bool = False,
        forgets: float = 0.0,
        slack: float | None = None,
        on_event: Callable[[Event], None] | None = None,
    ) -> None:
        """Take ownership of a port; arguments as for `Host`."""
        engine = make_engine(port, checksum=checksum, attempts=attempts, slack=slack, forgets=forgets)
        super().__init__(engine, port, on_event=on_event)
        self.command_errors = command_errors
        self.usage = Usage()

    @classmethod
    def open(
        cls,
        name: str,
        *,
        baud: int,
        checksum: Checksum = "always",
        attempts: int = 3,
        command_errors: bool = False,
        forgets: float = 0.0,
        slack: float | None = None,
        on_event: Callable[[Event], None] | None = None,
    ) -> AsyncHost:
        """Open a device name or a URL of pyserial; the sources state no speed. The rest as for the class.

        Raises:
            PortMissing: the port does not exist.
            PortBusy: another program uses it, or this user lacks the permission.
        """
        return cls(
            open_port(name, baud=baud),
            checksum=checksum,
            attempts=attempts,
            command_errors=command_errors,
            forgets=forgets,
            slack=slack,
            on_event=on_event,
        )

    def axis(self, number: int) -> AsyncAxis:
        """Return one axis, 1 or 2."""
        return AsyncAxis(self, number)

    async def ask(
        self,
        request: mc1231a.Message,
        response: type[R],  # noqa: ARG002  # for type checkers
        axis: int | None = None,
    ) -> R:
        """Send a packet, for an axis if one is given, and return its answer."""
        self.usage.note(request)
        context = None if axis is None else SELECT[check_axis(axis)]
        answer: R = (await self.transact(packet(request, context))).response
        return answer

    async def raise_command_error(self, axis: int) -> int:
        """As `Host.raise_command_error`."""
        return await self.run(updating.raise_command_error(axis))

    async def update(self, axis: int, *, check: bool | None = None) -> mc1231a.UpdateResponse:
        """As `Host.update`."""
        return await self.run(updating.update(axis, check=self.command_errors if check is None else check))

    async def multi_update(self, *, axes: int = 0, check: bool | None = None) -> mc1231a.MultiUpdateResponse:
        """As `Host.multi_update`."""
        return await self.run(
            updating.multi_update(axes, check=self.command_errors if check is None else check)
        )


class AsyncAxis(AsyncAxisCalls):
    """One axis: every command that acts on the current axis, without the axis argument.

    Attributes:
        host: the host.
        number: 1 or 2.
    """

    def __init__(self, host: AsyncHost, number: int) -> None:
        self.host = host
        self.number = check_axis(number)
        self._context = SELECT[number]

    async def ask(self, request: mc1231a.Message, response: type[R]) -> R:  # noqa: ARG002  # for type checkers
        """Send a packet for this axis and return its answer."""
        self.host.usage.note(request)
        answer: R = (await self.host.transact(packet(request, self._context))).response
        return answer

    async def raise_command_error(self) -> int:
        """As `Host.raise_command_error`."""
        return await self.host.raise_command_error(self.number)

    async def update(self, *, check: bool | None = None) -> mc1231a.UpdateResponse:
        """As `Host.update`."""
        return await self.host.update(self.number, check=check)
