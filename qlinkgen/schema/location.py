"""The location of a field in the document, for errors about its keys."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from pydantic import BaseModel

from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import Path


@dataclass(frozen=True, slots=True)
class Location:
    """Place of a field, a named type or a bit field.

    A fault about one key is concluded from the others too (a default from the scale), so it is only reported
    where the whole field is intact.
    """

    report: Reporter
    path: Path
    #: Keys that stand here; others were taken from a named type.
    written: frozenset[str] = frozenset()

    def fault(self, rule: str, key: str, message: str, hint: str = "") -> None:
        """Report a fault about the value of a key, or about the field where the key stands in its type."""
        self.report.error(rule, self.place(key), message, hint, needs=(self.path,))

    def key_fault(self, rule: str, key: str, message: str, hint: str = "") -> None:
        """Report a fault about a key being there at all."""
        self.report.error(rule, self.place(key), message, hint, of_key=True, needs=(self.path,))

    def reject(self, spec: BaseModel, keys: Iterable[str], what: str, hint: str = "remove it") -> None:
        """Report those of the keys that are given but mean nothing for ``what``."""
        for key in keys:
            if getattr(spec, key) not in (None, False, ""):
                self.key_fault("not-applicable", key, f"'{key}' has no effect on {what}", hint)

    def inner(self, *keys: str, written: Iterable[str] = ()) -> Location:
        """The place of something inside."""
        return Location(self.report, (*self.path, *keys), frozenset(written))

    def place(self, key: str) -> Path:
        """Where a key stands, or the field where it stands in its type."""
        return (*self.path, key) if key in self.written else self.path
