"""What the general commands know of the MC1231A besides its schema."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from qlinkgen.codecs import mc1231a
from qlinkgen.link.codec import Framed
from qlinkgen.link.procedure import Procedure
from qlinkgen.protocols.support import SimulatedDevice, Support


class ChipSupport(Support):
    """A chip set with moving axes, and its status word."""

    def device(self) -> SimulatedDevice:
        """Return a chip set with two axes."""
        from qlinkgen.protocols.mc1231a.chip import ChipSet  # noqa: PLC0415
        from qlinkgen.protocols.mc1231a.chip_engine import ChipEngine  # noqa: PLC0415

        chip = ChipSet()

        def report() -> list[str]:
            return [
                f"axis {number}: position {axis.actual}, status 0x{axis.status:04X}"
                for number, axis in chip.axes.items()
            ]

        return SimulatedDevice(ChipEngine(chip), "an mc1231a chip set", report)

    def check_after(self, request: Framed, selected: int | None) -> Procedure[None]:
        """Read the status word of each axis that a request acts on.

        Raises:
            ValueError: the axis is not known.
        """
        from qlinkgen.protocols.mc1231a.updating import axes_in  # noqa: PLC0415

        if selected is not None:
            return _check([selected])
        if isinstance(request, mc1231a.MultiUpdateRequest):
            return _check(axes_in(request.axes))
        raise ValueError("--check reads the status word of an axis; add --axis 1 or --axis 2")


def _check(axes: Iterable[int]) -> Procedure[None]:
    from qlinkgen.protocols.mc1231a.updating import raise_command_error  # noqa: PLC0415

    for axis in axes:
        yield from raise_command_error(axis)


SUPPORT: Final = ChipSupport("mc1231a")
