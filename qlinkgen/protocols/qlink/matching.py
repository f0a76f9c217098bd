"""Additional rules for matching responses to requests."""

from __future__ import annotations

from collections.abc import Mapping

from qlinkgen.codecs import qlink
from qlinkgen.link.transaction import Accepts


def _setup(request: qlink.NodeSetupRequest, response: qlink.NodeSetupResponse) -> bool:
    """The document does not say whether a renumbered node answers with its old or its new number."""
    if request.node == qlink.BUS.broadcast:
        return True
    return response.node in (request.node, request.node_number)


def _read(request: qlink.ReadRequest, response: qlink.ReadResponse) -> bool:
    return response.node == request.node and len(response.data) == request.size


#: Checks by command, for a master engine.
ACCEPTS: Mapping[str, Accepts] = {"node_setup": _setup, "read": _read}
