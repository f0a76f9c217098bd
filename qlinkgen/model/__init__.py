"""The model: the immutable description of a protocol for all back-ends and the runtime."""
