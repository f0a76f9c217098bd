"""What replaces parts of a schema's check value: the options ``--set crc=`` and ``--set crc_over=``."""

from __future__ import annotations

from qlinkgen._dataclass import dataclass


@dataclass(frozen=True, slots=True)
class Replacement:
    """Another check value than the one in the schema, for documents that leave it open.

    Attributes:
        algorithm: name from the catalogue; None for that of the schema.
        over: names of the parts that it covers; empty for those of the schema.
    """

    algorithm: str | None = None
    over: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Return it as options of a command."""
        given = (("crc", self.algorithm), ("crc_over", ",".join(self.over)))
        return " ".join(f"--set {key}={value}" for key, value in given if value)
