"""Codecs, documentation, test vectors and a runtime from the schema of a serial protocol.

The compiler (`schema`, `model`, `plan`, `backends`) generates code from a YAML schema; the runtime (`link`,
`transport`, `protocols`, `sim`) uses it on the wire. `cli` is the command line of both.
"""

__version__ = "0.1.0"
