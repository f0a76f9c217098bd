"""What the general commands know of Q.link besides its schema."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Final

from qlinkgen.link.slave import Node
from qlinkgen.link.transaction import Accepts
from qlinkgen.protocols.support import Question, Support


class QlinkSupport(Support):
    """Answers of renumbered nodes, the search for nodes, and nodes that behave as documented."""

    def accepts(self) -> Mapping[str, Accepts]:
        """Return the rules for node_setup and read."""
        from qlinkgen.protocols.qlink.matching import ACCEPTS  # noqa: PLC0415

        return ACCEPTS

    def questions(self) -> Sequence[Question]:
        """Ask with node_info, and those that do not support it with loop_back."""
        from qlinkgen.protocols.qlink.survey import QUESTIONS  # noqa: PLC0415

        return QUESTIONS

    def nodes(self, numbers: Iterable[int]) -> Sequence[Node]:
        """Return virtual nodes with serial numbers from 1001."""
        from qlinkgen.codecs.qlink import PositionType  # noqa: PLC0415
        from qlinkgen.protocols.qlink.virtual_node import VirtualNode  # noqa: PLC0415

        kind = PositionType.JVL_MACTALK  # a node of type none reports no position
        return [VirtualNode(number, position_type=kind, serial_number=1000 + number) for number in numbers]


SUPPORT: Final = QlinkSupport("qlink")
