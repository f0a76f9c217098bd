"""What the general commands know of the Trio network besides its schema."""

from __future__ import annotations

from typing import Final

from qlinkgen.protocols.support import Support

SUPPORT: Final = Support("trio", simulated=True)
