"""An independent codec and receiver, based only on docs/schema-reference.md and docs/receiver.md.

It parses the YAML itself, and shares only the catalogue of CRCs with qlinkgen. It is simple rather than fast:
with every byte of a stream a frame is checked again from its beginning.
"""

from tests.support.whole.reference.codec import Reference, Seen
from tests.support.whole.reference.receivers import Event
from tests.support.whole.reference.values import Raw, Wrong

__all__ = ["Event", "Raw", "Reference", "Seen", "Wrong"]
