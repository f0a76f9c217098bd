"""Protocol behaviour beyond encoding, for both sides of the wire."""
