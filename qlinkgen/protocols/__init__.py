"""Behaviour of the protocols beyond their bytes, for both sides of the wire."""
