"""All packages that do the same work; those not installed are listed as not measured.

A peer without frames gets Q.link's frame by hand (`wrap`, `unwrap`: the quick way), which favours it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from benchmarks.peer import Peer, PeerMissing
from benchmarks.peers_construct import construct_fields, construct_frame
from benchmarks.peers_generated import bitproto, cantools, mavlink

PEERS: tuple[Callable[[], Peer], ...] = (
    lambda: construct_frame(compiled=True),
    lambda: construct_frame(compiled=False),
    lambda: construct_fields(compiled=True),
    lambda: construct_fields(compiled=False),
    mavlink,
    cantools,
    bitproto,
)


def available(missing: list[str]) -> Iterator[Peer]:
    """The installed peers; for the others, `missing` gets the reason."""
    for peer in PEERS:
        try:
            yield peer()
        except PeerMissing as reason:
            missing.append(str(reason))
