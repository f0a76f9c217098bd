"""The end of answers of which each node in a list of the request sends one.

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
