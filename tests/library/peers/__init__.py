"""Adapters: what other people's libraries make of a message and of a frame."""
