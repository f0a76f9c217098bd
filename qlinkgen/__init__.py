"""Describe a serial protocol once, and get its codecs, documentation, test vectors and wire behaviour.

The package holds two towers. The compiler (`schema`, `model`, `backends`) turns a YAML description into code;
the runtime drives the wire with it. `cli` stands on top of both.
"""

__version__ = "0.1.0"
