"""An independent codec and receiver, written from docs/schema-reference.md and docs/receiver.md alone.

It reads the YAML itself, and shares nothing with qlinkgen but the catalogue of CRCs. It is written to be
plain, not fast: every byte of a stream is judged again from the beginning of its frame.
"""

from tests.support.whole.reference.codec import Reference, Seen
from tests.support.whole.reference.receivers import Event
from tests.support.whole.reference.values import Raw, Wrong

__all__ = ["Event", "Raw", "Reference", "Seen", "Wrong"]
