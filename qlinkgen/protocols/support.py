"""What general code asks of the behaviour that is written by hand for a protocol."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from qlinkgen.link.codec import Framed
    from qlinkgen.link.device import DeviceEngine
    from qlinkgen.link.procedure import Procedure
    from qlinkgen.link.slave import Node
    from qlinkgen.link.transaction import Accepts

#: A command and its values, as on a command line.
Question = tuple[str, tuple[str, ...]]


class SimulatedDevice(NamedTuple):
    """A device that is written by hand.

    Attributes:
        engine: what answers.
        what: its name, with an article.
        report: returns its state, a line for each part.
    """

    engine: DeviceEngine
    what: str
    report: Callable[[], Sequence[str]]


@dataclass(frozen=True)
class Support:
    """The behaviour of a protocol for which nothing is written by hand: what follows from its schema.

    The package of a protocol overrides what it has by hand. Methods import what they need, so that a command
    which asks for one thing does not load the rest.

    Attributes:
        name: the protocol.
        simulated: its nodes are written by hand, so that a ring of them can be simulated.
    """

    name: str
    simulated: bool = False

    def accepts(self) -> Mapping[str, Accepts] | None:
        """Return further rules for matching responses to requests, by command."""
        return None

    def questions(self) -> Sequence[Question]:
        """Return requests to find nodes with; none: the schema tells which one is harmless."""
        return ()

    def nodes(self, numbers: Iterable[int]) -> Sequence[Node] | None:  # noqa: ARG002
        """Return simulated nodes of the generated module in the package; None: those of any schema."""
        return None

    def device(self) -> SimulatedDevice | None:
        """Return a simulated device of a host; None: that of any schema."""
        return None

    def check_after(self, request: Framed, selected: int | None) -> Procedure[None]:  # noqa: ARG002
        """Return what reads from a device whether it has executed a request.

        Args:
            request: the request.
            selected: number of what it acts on, if one is given.

        Raises:
            ValueError: this cannot be read.
        """
        raise ValueError(f"{self.name} has no status word known here; omit --check")
