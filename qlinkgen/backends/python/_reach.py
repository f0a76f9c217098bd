"""Ends of several answers: one of each node in a list of the request, or none until another command.

Copied next to modules that use it, unchanged.
"""

from __future__ import annotations

from ._support import Many


class EachOf(Many):
    """Each node in a list sends an answer.

    Attributes:
        each: field of the request with the list.
        key: attribute of its records with the node, "" if it has the nodes themselves.
        by: attribute of an answer with its node, "" for the address.
    """

    __slots__ = ("by", "each", "key")

    def __init__(self, each: str, key: str, by: str, most: int) -> None:
        super().__init__(count=most)
        self.each = each
        self.key = key
        self.by = by


class UntilStopped(Many):
    """Answers come until another command stops them.

    Attributes:
        stopped_by: name of that command.
        repeats: attributes of its request that repeat those of the request.
        next_within: byte times and seconds from one answer to the next, None: as for the first.
    """

    __slots__ = ("next_within", "repeats", "stopped_by")

    def __init__(
        self,
        stopped_by: str,
        repeats: tuple[str, ...],
        next_within: tuple[float, float] | None,
    ) -> None:
        super().__init__()
        self.stopped_by = stopped_by
        self.repeats = repeats
        self.next_within = next_within
