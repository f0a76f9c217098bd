"""The location of a field in a schema file, for errors about its keys."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from pydantic import BaseModel

from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import Path


@dataclass(frozen=True, slots=True)
class Location:
    """Location of a field, a named type or a bit field.

    An error about one key depends on other keys too (a default on the scale), so it is reported only if the
    whole field is intact.
    """

    report: Reporter
    path: Path
    #: Keys written here; others were inherited from a named type.
    written: frozenset[str] = frozenset()

    def fault(self, rule: str, key: str, message: str, hint: str = "") -> None:
        """Report an error in the value of a key, at the field if the key is inherited."""
        self.report.error(rule, self.place(key), message, hint, needs=(self.path,))

    def key_fault(self, rule: str, key: str, message: str, hint: str = "") -> None:
        """Report a key that must not be present."""
        self.report.error(rule, self.place(key), message, hint, of_key=True, needs=(self.path,))

    def reject(self, spec: BaseModel, keys: Iterable[str], what: str, hint: str = "remove it") -> None:
        """Report the given keys that do not apply to ``what``."""
        fields = type(spec).model_fields
        given = {fields[name].alias or name: getattr(spec, name) for name in spec.model_fields_set}
        for key in keys:
            if given.get(key) not in (None, False, ""):
                self.key_fault("not-applicable", key, f"'{key}' has no effect on {what}", hint)

    def inner(self, *keys: str, written: Iterable[str] = ()) -> Location:
        """The location of a nested node."""
        return Location(self.report, (*self.path, *keys), frozenset(written))

    @staticmethod
    def written_in(spec: BaseModel) -> frozenset[str]:
        """The keys that a mapping of the file has."""
        fields = type(spec).model_fields
        return frozenset(fields[name].alias or name for name in spec.model_fields_set)

    def place(self, key: str) -> Path:
        """The path of a key, or of the field if the key is inherited."""
        return (*self.path, key) if key in self.written else self.path
