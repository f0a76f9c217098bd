"""The host of a chip set.

Derived from `aio.py` by `python -m tests.unasync`: change that one, and run it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from qlinkgen.codecs import mc1231a
from qlinkgen.codecs.mc1231a_bus import AxisCalls, HostCalls
from qlinkgen.link.events import Event
from qlinkgen.link.host import HostEngine
from qlinkgen.protocols.mc1231a import updating
from qlinkgen.protocols.mc1231a.facts import SELECT, check_axis
from qlinkgen.protocols.mc1231a.usage import Checksum, Usage, make_engine, packet
from qlinkgen.transport.blocking import BlockingMaster
from qlinkgen.transport.opening import closing_on_error, open_port
from qlinkgen.transport.port import Port

R = TypeVar("R", bound=mc1231a.Message)


class Host(BlockingMaster, HostCalls):
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
        """Take ownership of a port; closing the host closes it.

        Args:
            port: the port of the chip set.
            checksum: commands whose checksum is read: "always", "never", or names. Without it, the loss or
                corruption of a packet is not detected.
            attempts: most transmissions of a packet, the first included; packets that are unsafe to repeat
                are sent once.
            command_errors: update and multi_update also read the status word, and raise CommandError.
            forgets: seconds of silence after which the chip's side of the link discards an incomplete packet;
                0 if it never does.
            slack: largest delay in seconds that driver, adapter and operating system add to a transaction; by
                default derived from the port.
            on_event: called with each event, in the calling thread.
        """
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
    ) -> Host:
        """Open a device name or a URL of pyserial; the sources state no speed. The rest as for the class.

        Raises:
            PortMissing: the port does not exist.
            PortBusy: another program uses it, or this user lacks the permission.
        """
        with closing_on_error(open_port(name, baud=baud)) as port:
            return cls(
                port,
                checksum=checksum,
                attempts=attempts,
                command_errors=command_errors,
                forgets=forgets,
                slack=slack,
                on_event=on_event,
            )

    def axis(self, number: int) -> Axis:
        """Return one axis, 1 or 2."""
        return Axis(self, number)

    def ask(
        self,
        request: mc1231a.Message,
        response: type[R],  # noqa: ARG002  # for type checkers
        axis: int | None = None,
    ) -> R:
        """Send a packet, for an axis if one is given, and return its answer."""
        self.usage.note(request)
        context = None if axis is None else SELECT[check_axis(axis)]
        reply = self.transact(packet(request, context))
        answer: R = reply.response
        return answer

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


class Axis(AxisCalls):
    """One axis: every command that acts on the current axis, without the axis argument.

    Attributes:
        host: the host.
        number: 1 or 2.
    """

    def __init__(self, host: Host, number: int) -> None:
        self.host = host
        self.number = check_axis(number)
        self._context = SELECT[number]

    def ask(self, request: mc1231a.Message, response: type[R]) -> R:  # noqa: ARG002  # for type checkers
        """Send a packet for this axis and return its answer."""
        self.host.usage.note(request)
        reply = self.host.transact(packet(request, self._context))
        answer: R = reply.response
        return answer

    def raise_command_error(self) -> int:
        """As `Host.raise_command_error`."""
        return self.host.raise_command_error(self.number)

    def update(self, *, check: bool | None = None) -> mc1231a.UpdateResponse:
        """As `Host.update`."""
        return self.host.update(self.number, check=check)
