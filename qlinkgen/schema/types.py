"""Second pass, types: builds the types of fields, and resolves named types."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

from qlinkgen.model.types import Array, Bits, Blob, Scalar
from qlinkgen.schema.compounds import bit_scalar, build_array, build_bits, build_blob
from qlinkgen.schema.constants import INTEGER, MAX_BITS, build_enum, build_flags
from qlinkgen.schema.file_fields import BitSpec, FieldSpec, RecordSpec
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.location import Location
from qlinkgen.schema.notation import TypeText, type_text
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.scalars import FIXED, FLOAT, KEYWORDS, ScalarBuilder
from qlinkgen.schema.source import Path

_GROUPS = ("enums", "flags", "types")
#: Maximum length of a chain of named types.
_MAX_CHAIN = 20

#: The type of a field that is not a record.
Simple = Scalar | Bits | Blob | Array


class TypeBuilder:
    """Holds the named types of one file and builds the types of fields."""

    def __init__(self, file: SchemaFile, report: Reporter, payload_max: int) -> None:
        """``payload_max`` limits byte strings and arrays without a bound."""
        self._file = file
        self._report = report
        self._payload_max = payload_max
        self.enums = {name: build_enum(name, spec, report) for name, spec in file.enums.items()}
        self.flags = {name: build_flags(name, spec, report) for name, spec in file.flags.items()}
        self._scalars = ScalarBuilder(file, self.enums, self.flags)
        #: Fields without a bound; the rest of the payload limits them.
        self.unbounded: set[Path] = set()
        self._checked: set[str] = set()
        self._chain = 0
        self._check_names()
        for name in file.types:
            self._check_named(name)

    def _check_names(self) -> None:
        seen: dict[str, str] = {}
        for group in _GROUPS:
            for name in getattr(self._file, group):
                path = (group, name)
                if name in KEYWORDS or any(each.match(name) for each in (INTEGER, FIXED, FLOAT)):
                    what = f"'{name}' is a built-in type"
                    self._report.error("type-clash", path, what, "rename it", of_key=True, needs=())
                elif name in seen:
                    what = f"'{name}' is also defined under {seen[name]}"
                    self._report.error("type-clash", path, what, "rename one of them", of_key=True, needs=())
                seen.setdefault(name, group)

    def _check_named(self, name: str) -> None:
        """Report an error in a named type once, at its definition."""
        spec, path = self._file.types[name], ("types", name)
        if isinstance(spec, RecordSpec) or name in self._checked or self._chain > _MAX_CHAIN:
            return
        self._checked.add(name)
        self._chain += 1
        before = len(self._report.faults)
        for attribute, key in (
            ("counts", "counts"),
            ("echo", "echo"),
            ("equals", "equals"),
            ("algorithm", "algorithm"),
            ("when", "if"),
            ("optional", "optional"),
            *((key, key) for key in ("since", "until", "deprecated")),
        ):
            if getattr(spec, attribute):
                what = f"'{key}' has no effect on a named type"
                self._report.error("not-applicable", (*path, key), what, "put it on a field", of_key=True)
        if self.build(spec, path, (name,)) is None or len(self._report.faults) > before:
            self._report.taint(path)
        self._chain -= 1

    def in_bytes(self) -> TypeBuilder:
        """The same types for parts of a frame, which `groups` of the file does not apply to."""
        found, file = copy(self), self._file.model_copy(update={"groups": None})
        found._file, found._scalars = file, self._scalars.in_bytes(file)  # noqa: SLF001 - of the same class
        return found

    def bits(self, spec: BitSpec, path: Path) -> Scalar | None:
        """The number in bits of an integer; None if its type is unknown."""
        location = Location(self._report, path, frozenset(spec.model_fields_set))
        return bit_scalar(spec, spec.at[1] + 1 - spec.at[0], self._scalars, location)

    def use(self, name: str) -> None:
        """Note that a record is used."""
        self._scalars.used.add(name)

    def report_unused(self) -> None:
        """Warn of unused types."""
        for group in _GROUPS:
            for name in getattr(self._file, group):
                if name not in self._scalars.used and not self._report.included((group, name)):
                    hint = "remove it, or use it as the type of a field"
                    needs = (("commands",), ("messages",), ("types",), ("defaults",))
                    what = f"'{name}' is not used"
                    self._report.error("unused-type", (group, name), what, hint, of_key=True, needs=needs)

    def build(self, spec: FieldSpec, path: Path, seen: tuple[str, ...] = ()) -> Simple | None:
        """The type of a field; None after an error that prevents building it.

        ``seen`` are the named types being built, to detect recursion.
        """
        location = Location(self._report, path, Location.written_in(spec))
        location.reject(spec, ("last",), "a field that is not an array of records")
        if spec.algorithm is None:
            location.reject(spec, ("init", "over"), "a field without algorithm")
        resolved = self._resolve(spec, location, seen)
        kind = self._build(*resolved, location) if resolved else None
        if kind is None:
            self._report.taint(path)
        return self._named(spec, kind)

    def _named(self, spec: FieldSpec, kind: Simple | None) -> Simple | None:
        """The type with its name in the file."""
        if not isinstance(kind, Scalar | Array):
            return kind
        name = type_text(spec.type).base
        if name not in self._file.types:
            return kind
        if isinstance(kind, Array):
            return replace(kind, item=replace(kind.item, type_name=name))
        return replace(kind, type_name=name)

    def _build(self, spec: FieldSpec, text: TypeText, location: Location) -> Simple | None:
        if text.base in ("bytes", "text"):
            self._note_unbounded(text, location)
            return self._blob(spec, text, location)
        plain = self._scalars.named(text.base, location, text.count)
        location.reject(spec, ("pad", "terminator") if spec.as_ is None else ("terminator",), "numbers")
        if plain is None:
            return None
        if text.count is not None:
            self._note_unbounded(text, location)
            if plain.bits > MAX_BITS:
                what = f"an item of an array cannot have {plain.bits} bits"
                location.fault("bad-array", "type", what, f"use bytes, or at most {MAX_BITS} bits")
                return None
            item = self._scalars.build(_item(spec, text.base, location), text.base, plain, location)
            return build_array(item, spec, text, self._payload_max, location) if item else None
        location.reject(spec, ("packed",), "a single number")
        if spec.bits is None:
            return self._scalars.build(spec, text.base, plain, location)
        if plain.bits > MAX_BITS:
            what = f"an integer with bits cannot have {plain.bits} bits"
            location.fault("bad-width", "type", what, f"use at most {MAX_BITS}")
            return None
        container = self._scalars.build(_bare(spec, text.base), text.base, plain, location)
        return build_bits(spec, container, self._scalars, location) if container else None

    def _blob(self, spec: FieldSpec, text: TypeText, location: Location) -> Simple | None:
        if text.base == "bytes" and self._file.groups is not None:
            hint = f"use text or an array of u{self._file.groups.bits}"
            location.fault(
                "bad-width", "type", f"bytes cannot be sent in groups of {self._file.groups.bits} bits", hint
            )
            return None
        return build_blob(spec, text, self._payload_max, location)

    def _note_unbounded(self, text: TypeText, location: Location) -> None:
        if not (text.count or "").strip():
            self.unbounded.add(location.path)

    # Named types

    def _resolve(
        self, spec: FieldSpec, location: Location, seen: tuple[str, ...]
    ) -> tuple[FieldSpec, TypeText] | None:
        """Resolve named types to a built-in type, an enum or flags."""
        try:
            text = type_text(spec.type)
        except ValueError as error:
            what, _, hint = str(error).partition("; ")
            location.fault("unknown-type", "type", what, hint)
            return None
        named = self._file.types.get(text.base)
        if named is None or text.base in KEYWORDS:
            return spec, text
        self._scalars.used.add(text.base)
        if isinstance(named, RecordSpec):
            what = f"'{text.base}' is a record, which cannot have another name"
            location.fault("not-applicable", "type", what, "use the record itself as the type of fields")
            return None
        self._check_named(text.base)
        if self._report.touched(("types", text.base)):
            self._report.taint(location.path)
        if text.base in seen or len(seen) > _MAX_CHAIN:
            what = (
                f"type '{text.base}' contains itself"
                if text.base in seen
                else "the chain of types is too long"
            )
            location.fault("recursive-type", "type", what, "use a built-in type")
            return None
        return self._refine(spec, text, named, location, (*seen, text.base))

    def _refine(
        self, spec: FieldSpec, text: TypeText, named: FieldSpec, location: Location, seen: tuple[str, ...]
    ) -> tuple[FieldSpec, TypeText] | None:
        """Merge the keys of a field into those of its named type."""
        resolved = self._resolve(named, location, seen)
        if resolved is None:
            return None
        base, below = resolved
        if below.count is not None and text.count is not None:
            location.fault("bad-array", "type", f"'{spec.type}' would be an array of arrays", "use one count")
            return None
        merged = base.model_copy(
            update={key: getattr(spec, key) for key in spec.model_fields_set if key != "type"}
        )
        return merged, TypeText(below.base, below.count if text.count is None else text.count)


def _item(spec: FieldSpec, base: str, location: Location) -> FieldSpec:
    """The keys of the items of an array, with the default of their named type."""
    keys = [
        "byteorder",
        "groups",
        "parts",
        "scale",
        "offset",
        "unit",
        "range",
        "raw_range",
        "packed",
        "as_",
        "pad",
    ]
    keys += ["default"] if "default" not in location.written and not isinstance(spec.default, list) else []
    return FieldSpec(type=base).model_copy(update={key: getattr(spec, key) for key in keys})


def _bare(spec: FieldSpec, base: str) -> FieldSpec:
    """The keys of the integer of an array or of bit fields."""
    return FieldSpec(type=base, byteorder=spec.byteorder, groups=spec.groups, parts=spec.parts)
