"""The protocols whose behaviour is written by hand, found by the facts of a schema.

A schema is one of them if the generated module in the package is made from the same text; wherever its file
is. Any other schema, a changed copy included, gets the behaviour that follows from what it states.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from types import ModuleType
from typing import TYPE_CHECKING, Final

from qlinkgen.model.protocol import Protocol
from qlinkgen.model.transaction import BusKind

if TYPE_CHECKING:
    from qlinkgen.protocols.support import Support

#: Protocols in the package, by name and kind of bus, and the modules that have their support.
_SUPPORTS: Final[Mapping[tuple[str, BusKind], str]] = {
    ("qlink", "master_slave"): "qlinkgen.protocols.qlink.support",
    ("trio", "ring"): "qlinkgen.protocols.trio.support",
    ("mc1231a", "host"): "qlinkgen.protocols.mc1231a.support",
}


def support_of(protocol: Protocol) -> Support:
    """Return the behaviour of a protocol besides its schema."""
    from qlinkgen.protocols.support import Support  # noqa: PLC0415  # decoding needs no engine

    if codec_of(protocol) is None:
        return Support(protocol.name)
    found: Support = importlib.import_module(_SUPPORTS[protocol.name, protocol.bus.kind]).SUPPORT
    return found


def codec_of(protocol: Protocol) -> ModuleType | None:
    """Return the generated module in the package, None if it is made from another schema.

    It computes the check value of the schema, even if that of the protocol is replaced.
    """
    if protocol.version or (protocol.name, protocol.bus.kind) not in _SUPPORTS:
        return None
    module = importlib.import_module(f"qlinkgen.codecs.{protocol.name}")
    return module if protocol.schema_hash in (module.__doc__ or "") else None


def supported(kind: BusKind) -> list[str]:
    """Return the names of the protocols of a kind of bus with hand-written behaviour."""
    return [name for name, its in _SUPPORTS if its == kind]
