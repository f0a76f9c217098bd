"""The one frozen description of a protocol that every back-end and the runtime read."""
