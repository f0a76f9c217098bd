"""Second pass, records: builds the layouts of records, and the fields that hold them."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from qlinkgen.model.condition import Condition
from qlinkgen.model.fields import Field, Layout, Record, Records
from qlinkgen.model.types import Array, Length, Scalar
from qlinkgen.model.values import defaults_of
from qlinkgen.schema.bit_items import bit_types
from qlinkgen.schema.compounds import build_length
from qlinkgen.schema.conditions import EndBuilder
from qlinkgen.schema.file_base import Fact, Lifetime
from qlinkgen.schema.file_fields import Fields, FieldSpec, RecordSpec
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.location import Location
from qlinkgen.schema.notation import TypeText, type_text
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.source import Path

#: Maximum number of records inside each other.
_MAX_DEPTH = 3
#: Keys of a field that apply to a record.
_KEYS = frozenset({"type", "echo", "if", "optional", "last", *Fact.model_fields, *Lifetime.model_fields})


class RecordBuilder:
    """Builds each record of a file once."""

    def __init__(
        self, file: SchemaFile, report: Reporter, fields: Callable[[Fields, Path], tuple[Field, ...]]
    ) -> None:
        """``fields`` builds the fields of a record."""
        self._file = file
        self._report = report
        self._fields = fields
        self._bits = bit_types(file)
        self._built: dict[str, Layout | None] = {}
        #: Records being built, to detect recursion.
        self._open: list[str] = []

    def check(self) -> None:
        """Build every record."""
        for name, spec in self._file.types.items():
            if isinstance(spec, RecordSpec):
                self._layout(name)

    def named(self, spec: FieldSpec) -> TypeText | None:
        """The type of a field that holds records, None for other fields."""
        try:
            text = type_text(spec.type)
        except ValueError:
            return None
        item = text.count is not None and text.base in self._bits
        return text if item or isinstance(self._file.types.get(text.base), RecordSpec) else None

    def build(
        self, spec: FieldSpec, text: TypeText, payload_max: int, location: Location
    ) -> Record | Records | None:
        """The type of a field that holds one record or several."""
        location.reject(spec, sorted(Location.written_in(spec) - {*_KEYS}), "a record")
        if text.count is None:
            location.reject(spec, ("last",), "a single record")
        if text.base in self._open:
            what = f"record '{text.base}' contains itself"
            location.fault("recursive-type", "type", what, "use another type")
            layout = None
        else:
            layout = self._layout(text.base)
        if layout is None or self._report.touched(("types", text.base)):
            self._report.taint(location.path)
        if layout is None:
            return None
        if text.count is None:
            return Record(layout)
        length = build_length(text, 8 * layout.least, payload_max, location)
        if length is None:
            self._report.taint(location.path)
            return None
        self._check_bound(text, layout, spec, location)
        self._check_rest(layout, length, location)
        last = self._last(spec, layout, length, location) if spec.last else ()
        return Records(layout, length, required=length.minimum > 0 and not last, last=last)

    def _check_bound(self, text: TypeText, layout: Layout, spec: FieldSpec, location: Location) -> None:
        if not (text.count or "").strip() and (not layout.fixed or spec.last):
            what = f"the number of records {layout.name} has no bound, and their size varies"
            location.fault("bad-record", "type", what, f"write a bound, like {layout.name}[0..8]")

    @staticmethod
    def _check_rest(layout: Layout, length: Length, location: Location) -> None:
        """Check that records take the rest of the payload on a condition, so that others come before it."""
        if final := next((each for each in _open_fields(layout) if each.final), None):
            name = final.slot or final.name
            what = f"the last record of {name} tells whether {layout.name} takes the rest of the payload"
            location.fault("bad-record", "type", what, f"put a count of bytes before {name}")
        elif rest := _always_open(layout):
            what = f"{rest} takes the rest of the payload, so that a second {layout.name} has no bytes"
            hint = f"put a count before {rest}, give it an if, or use one {layout.name}"
            location.fault("bad-record", "type", what, hint)
        elif length.minimum > 1 and layout.takes_rest(defaults_of(layout)):
            what = f"a new {layout.name} takes the rest of the payload, so that a second one has no bytes"
            hint = "give the tested field another default, or the array a minimum of 1"
            location.fault("bad-record", "type", what, hint)

    def _last(self, spec: FieldSpec, layout: Layout, length: Length, location: Location) -> Condition:
        """The condition that the last record meets, and none before it."""
        if length.minimum != 1 or length.maximum == 1:
            what = "an array that ends with its last record has at least one, and a bound"
            location.fault("bad-record", "type", what, f"write {layout.name}[1..{max(2, length.maximum)}]")
        tests = EndBuilder(layout, location).tests(spec.last or ())
        if not tests:
            self._report.taint(location.path)
        values = {value.name: value.type for value in layout.values}
        kinds = [(test, values[test.value]) for test in tests]
        if not all(test.holds(kind.default) for test, kind in kinds if isinstance(kind, Scalar)):
            what = f"a new record {layout.name} is not a last one, so a new message has none"
            location.key_fault("bad-record", "last", what, "give the tested field a default that is one")
        return tests

    def _layout(self, name: str) -> Layout | None:
        if name not in self._built:
            self._open.append(name)
            self._built[name] = self._new(name)
            self._open.pop()
        return self._built[name]

    def _new(self, name: str) -> Layout | None:
        spec, path = self._file.types[name], ("types", name)
        if not isinstance(spec, RecordSpec):
            spec = self._bits[name]
            self._report.move((*path, "fields"), path)
            self._report.move((*path, "fields", name), path)
        before = len(self._report.faults)
        layout = Layout(
            name, self._fields(spec.fields, (*path, "fields")), spec.doc, spec.section, spec.confirmed
        )
        self._check(layout, path)
        if len(self._report.faults) > before:
            self._report.taint(path)
        return layout if layout.least else None

    def _check(self, layout: Layout, path: Path) -> None:
        if not layout.values:
            what = f"record {layout.name} has no value: its fields are constants or reserved"
            hint = "add a field with a value, or put these fields into the messages"
            self._report.error("bad-record", path, what, hint, of_key=True, needs=((*path, "fields"),))
        elif layout.fields and not layout.least:
            what = f"a record {layout.name} may be empty, so bytes do not tell the number of them"
            hint = "add a field that is always present"
            self._report.error("bad-record", path, what, hint, of_key=True, needs=((*path, "fields"),))
        for field in layout.fields:
            place = (*path, "fields", field.name)
            if isinstance(field.type, Array) and field.type.packed and not field.type.length.fixed:
                what = f"{field.slot or field.name} is packed and of variable size, in a record"
                self._report.error("bad-record", place, what, "give it a fixed number of items", of_key=True)
            if field.optional:
                what = (
                    f"{field.name} is optional, but bytes after a record {layout.name} may belong to others"
                )
                hint = "say in an earlier field whether it is present, and write if"
                self._report.error("bad-record", (*place, "optional"), what, hint, of_key=True)
            if _depth((field,)) >= _MAX_DEPTH:
                what = f"{field.name} would be a record inside of {_MAX_DEPTH} others"
                hint = "use fields in place of one of the records"
                self._report.error("extent-depth", place, what, hint, of_key=True)


def _open_fields(layout: Layout) -> Iterator[Field]:
    """The fields of a record, and of records in it, that take the rest of the payload."""
    for each in layout.fields:
        if each.open:
            yield from _open_fields(each.type.layout) if isinstance(each.type, Record) else (each,)


def _always_open(layout: Layout) -> str:
    """The field that takes the rest of the payload in every record, "" if there is none."""
    for each in layout.fields:
        kind = each.type
        if each.open and not each.when and (not isinstance(kind, Record) or _always_open(kind.layout)):
            return each.slot or each.name
    return ""


def _depth(fields: tuple[Field, ...]) -> int:
    """Number of records inside each other."""
    inner = [each.type.layout for each in fields if isinstance(each.type, Record | Records)]
    return max((1 + _depth(layout.fields) for layout in inner), default=0)
