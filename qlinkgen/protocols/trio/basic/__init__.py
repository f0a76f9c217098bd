"""The network words of Trio BASIC: programs of Motion Coordinators, without axes.

`parse` reads a program, `ProgrammedNode` runs it as a node of a ring.
"""

from __future__ import annotations

from qlinkgen.protocols.trio.basic.errors import BasicError, Place
from qlinkgen.protocols.trio.basic.items import Pointed
from qlinkgen.protocols.trio.basic.machine import Machine
from qlinkgen.protocols.trio.basic.node import ProgrammedNode
from qlinkgen.protocols.trio.basic.parser import Program, parse

__all__ = ["BasicError", "Machine", "Place", "Pointed", "Program", "ProgrammedNode", "parse"]
