"""Second pass, fields: builds the fields of a message and connects counts to fields."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from qlinkgen.model.condition import exclusive
from qlinkgen.model.digits import Digits
from qlinkgen.model.fields import Field, FieldType, Record, Records, greatest_size
from qlinkgen.model.types import Array, Blob, Count, Scalar
from qlinkgen.schema.conditions import ConditionBuilder
from qlinkgen.schema.counted import with_counts
from qlinkgen.schema.counting import choice_fault, scale_fault, with_beside
from qlinkgen.schema.file_fields import Fields, FieldSpec, RecordSpec
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.filled import FilledBuilder
from qlinkgen.schema.frame_values import FrameValues
from qlinkgen.schema.location import Location
from qlinkgen.schema.notation import Divider, shown, type_text
from qlinkgen.schema.records import RecordBuilder
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.source import Path
from qlinkgen.schema.types import TypeBuilder

_UNDIVIDED = Divider()
_NO_VALUES = FrameValues()


class FieldBuilder:
    """Builds the fields of messages."""

    def __init__(self, file: SchemaFile, report: Reporter, types: TypeBuilder, payload_max: int) -> None:
        """``payload_max`` limits the fields without a bound."""
        self._file = file
        self._report = report
        self._types = types
        self._payload_max = payload_max
        self._records = RecordBuilder(file, report, self.build)

    def check_records(self) -> None:
        """Report errors in records at their definition, whether used or not."""
        self._records.check()

    def build(
        self,
        specs: Fields,
        path: Path,
        asked: Collection[str] = (),
        *,
        divider: Divider = _UNDIVIDED,
        beside: FrameValues = _NO_VALUES,
    ) -> tuple[Field, ...]:
        """The fields of one message, without those that cannot be built.

        ``asked`` are those with a number of items from the request; ``divider`` is the separator of texts;
        ``beside`` are values of its frame.
        """
        separated = bool(divider.byte)
        written = specs
        specs = with_counts({name: spec.itself for name, spec in specs.items()}, path, self._report)
        fields: list[Field] = []
        for name, spec in specs.items():
            kind = self._kind(spec, (*path, name))
            if kind is not None:
                if not separated:
                    self._check_text(kind, (*path, name))
                doc, confirmed = self._inherited(spec)
                repeats, proves = written[name].repeated(name), written[name].proves
                field = Field(name, kind, doc, spec.section, confirmed, repeats, proves)
                of = spec.case
                fields.append(field if of is None else replace(field, slot=of.slot, case=of.name))
        fields = with_beside(fields, specs, path, self._report)
        conditions = ConditionBuilder(specs, path, self._report, separated=separated, beside=beside)
        fields = conditions.build(fields)
        fields = self._counted(fields, path, asked)
        fields = FilledBuilder(specs, path, self._report).build(fields)
        if not separated:
            self._check_open_ends(fields, path)
        return tuple(
            self._bounded(fields, path, separators=len(fields) - (not divider.before) if separated else 0)
        )

    def _check_text(self, kind: FieldType, path: Path) -> None:
        """Check that a receiver finds the end of a number as text."""
        number = kind.item if isinstance(kind, Array) else kind
        if isinstance(number, Scalar) and number.text and isinstance(number.role, Count):
            what = f"{path[-1]} is a count as text, which only messages with a separator have"
            self._report.error("bad-digits", path, what, "remove as", of_key=True)
        elif isinstance(number, Scalar) and number.text and not number.text.fixed:
            text = number.text
            what = f"the text of {path[-1]} has {text.least} to {text.most} characters"
            hint = "use words of one length, or a separator"
            if isinstance(text, Digits):
                hint = f"use a constant number, as: {text.name}[{text.most}], or a separator"
            self._report.error("bad-digits", path, what, hint, of_key=True)

    def _kind(self, spec: FieldSpec, path: Path) -> FieldType | None:
        record = self._records.named(spec)
        if record is None:
            return self._types.build(spec, path)
        self._types.use(record.base)
        if not record.count and record.count is not None:
            self._types.unbounded.add(path)
        location = Location(self._report, path, frozenset(spec.model_fields_set))
        return self._records.build(spec, record, self._payload_max, location)

    def _inherited(self, spec: FieldSpec) -> tuple[str, bool]:
        """The first description of a field and its named types, and whether all of them are confirmed."""
        doc, confirmed, seen = spec.doc, spec.confirmed, set[str]()
        while (name := type_text(spec.type).base) not in seen:
            seen.add(name)
            named = self._file.types.get(name)
            last = named or self._file.enums.get(name) or self._file.flags.get(name)
            if last is not None:
                doc, confirmed = doc or last.doc, confirmed and last.confirmed
            if named is None or isinstance(named, RecordSpec):
                break
            spec = named
        return doc, confirmed

    # Counts

    def _counted(self, fields: Sequence[Field], path: Path, asked: Collection[str]) -> list[Field]:
        """The fields, each with the name of its count."""
        counters: dict[str, str] = {}
        for field in fields:
            if isinstance(field.type, Scalar) and isinstance(count := field.type.role, Count):
                place = (*path, field.name, "counts")
                if self._check_count(field, field.type, count, fields, place):
                    row = next(each.type for each in fields if count.run in (each.name, each.slot))
                    if count.unit != "bytes" or count.run in counters or not _is_row(row):
                        pass
                    elif count.run in asked:
                        fields = self._whole(fields, count.run, (*path, count.run))
                    else:
                        what = f"{field.name} does not tell the number of items of {count.run}"
                        hint = "a byte may hold several; put a count in items before it"
                        self._report.error(
                            "bad-count", place, what, hint, needs=(place[:-1], (*path, count.run))
                        )
                    counters.setdefault(count.run, field.name)
        roles = [each.type.role for each in fields if isinstance(each.type, Scalar)]
        measured = {role.run for role in roles if isinstance(role, Count) and role.unit == "bytes"}
        fields = [replace(each, counted=_is_sized(each, counters, measured)) for each in fields]
        return [_with_counter(field, counters.get(field.slot or field.name)) for field in fields]

    def _whole(self, fields: Sequence[Field], name: str, path: Path) -> Sequence[Field]:
        """The fields; a row whose bytes alone are counted may have as many items as fit them."""
        row = next(field.type for field in fields if field.name == name)
        assert isinstance(row, Array)
        item, most = row.item, row.items_in(row.size_of(row.length.maximum))
        if item.bits > 8 or not item.minimum <= 0 <= item.maximum:
            what = f"the bytes of {name} do not tell the number of its items without the request"
            hint = "use items of up to 8 bits which may be 0, or put a count in items before it"
            self._report.error("bad-count", path, what, hint, of_key=True)
        row = replace(row, whole=True, length=replace(row.length, maximum=most))
        return [replace(field, type=row) if field.name == name else field for field in fields]

    def _check_count(
        self, field: Field, scalar: Scalar, count: Count, fields: Sequence[Field], path: Path
    ) -> bool:
        later = {each.name: each for each in fields[fields.index(field) + 1 :]}
        target = later.get(count.run)
        needs = (path[:-1], (*path[:-2], count.run))
        if any(each.slot == count.run for each in later.values()):
            if fault := choice_fault(field, count):
                self._report.error("bad-count", path, *fault, needs=needs)
            return True  # an encoder refuses what it cannot count
        if target is not None and target.terminated:
            what = f"{target.name} has a terminator, which tells its size"
            self._report.error("bad-count", path, what, "remove the count, or the terminator", needs=needs)
            self._report.taint(path)
            return False
        if target is not None and isinstance(target.type, Record | Records) and target.walked:
            if not _is_countable(target.type):
                what = f"{field.name} cannot count {target.name}, whose end its records tell"
                self._report.error("bad-count", path, what, "remove the count", needs=needs)
                self._report.taint(path)
                return False
        elif target is None or not _is_countable(target.type):
            known = [name for name, other in later.items() if not other.fixed]
            hint = did_you_mean(count.run, known, f"fields of variable size: {listed(known)}")
            what = f"{field.name} is not followed by a field {shown(count.run)} of variable size"
            self._report.error("bad-count", path, what, hint, needs=needs)
            self._report.taint(path)
            return False
        assert isinstance(target.type, Blob | Array | Records)
        # An item of a byte string is a byte.
        unit = "bytes" if isinstance(target.type, Blob) else count.unit
        most = target.type.length.maximum
        most = target.type.size_of(most) if unit == "bytes" else most
        more = sum(each.max_size for each in fields if each.name in count.beside)
        if fault := scale_fault(count, target, unit, more):
            key = "offset" if count.offset else "scale"
            self._report.error("bad-count", (*path[:-1], key), *fault, needs=needs)
            self._report.taint(path)
            return False
        if target.walked and unit == "bytes":
            return True  # an encoder refuses what it cannot count
        most = (most + more - count.offset) // count.scale
        if most > scalar.maximum and (*path[:-2], target.name) not in self._types.unbounded:
            what = f"{field.name} counts up to {scalar.maximum}, but {target.name} has up to {most} {unit}"
            self._report.error(
                "bad-count", path, what, f"shorten {target.name}, or use a wider count", needs=needs
            )
        return True

    def _check_open_ends(self, fields: Sequence[Field], path: Path) -> None:
        self._check_packed(fields, path)
        open_fields = [field for field in fields if field.open]
        open_ends = [field.name for field in open_fields]
        # An integer with an error may be the count of one of them.
        counts = [(*path, field.name) for field in fields if isinstance(field.type, Scalar)]
        for index, field in enumerate(open_fields):
            earlier = (each for each in open_fields[:index] if not exclusive(each.when, field.when))
            other, name = next(earlier, None), field.name
            if other is None:
                continue
            what = f"{name} and {other.name} both take the rest of the payload"
            needs = ((*path, name), (*path, other.name))
            hint = "give one of them a count, or a fixed size"
            self._report.error(
                "two-open-ends", (*path, name), what, hint, of_key=True, needs=(*needs, *counts)
            )
            self._report.taint((*path, name))
        for field in open_fields:
            later = fields[fields.index(field) + 1 :]
            final = field.final
            varied = (each for each in later if each.terminated or each.walked or final)
            ended = (each for each in varied if not exclusive(each.when, field.when))
            if other := next(ended, None):
                what = f"{field.name} takes the rest of the payload, before {other.name}, whose size varies"
                what = f"{field.name} takes the rest of the payload, before {other.name}" if final else what
                both = ((*path, field.name), (*path, other.name), *counts)
                counted = "the field in it" if final else field.name
                hint = f"move {other.name} before it, or give {counted} a count"
                self._report.error("two-open-ends", (*path, other.name), what, hint, of_key=True, needs=both)
        if open_ends:
            self._check_later_counts(open_ends[0], fields, path, counts)

    def _check_packed(self, fields: Sequence[Field], path: Path) -> None:
        """Check that a packed array of variable size has a count."""
        counts = [(*path, field.name) for field in fields if isinstance(field.type, Scalar)]
        for field in fields:
            if field.open and _is_row(field.type):
                name = field.slot or field.name
                what = f"the size of the payload does not tell the number of items of {name}"
                hint = f"add a field with counts: {name} before it, or use a fixed number"
                hint = "use a fixed number" if field.slot else hint
                place = (*path, field.name)
                self._report.error("bad-count", place, what, hint, of_key=True, needs=(place, *counts))
                self._report.taint(place)
        ended = next((field for field in fields if field.terminated), None)
        for field in fields if ended else ():
            if _is_row(field.type) and not field.fixed:
                name = field.slot or field.name
                what = f"{name} is packed and of variable size, beside a text with a terminator"
                hint, place = "give it a fixed number of items", (*path, field.name)
                self._report.error("bad-terminated", place, what, hint, of_key=True, needs=(place, path))

    def _check_later_counts(
        self, name: str, fields: Sequence[Field], path: Path, counts: Sequence[Path]
    ) -> None:
        """Check that counts precede a field that takes the rest of the payload."""
        order = [field.name for field in fields]
        for field in fields[order.index(name) + 1 :]:
            if not isinstance(field.type, Blob | Array | Records) or field.type.length.fixed:
                continue
            count = field.type.length.counted_by
            if count and order.index(count) > order.index(name):
                what = (
                    f"{count}, the count of {field.name}, follows {name}, which takes the rest of the payload"
                )
                hint = f"move {count} before {name}, or give {name} a count"
                needs = ((*path, name), (*path, count), (*path, field.name), *counts)
                self._report.error("bad-count", (*path, count, "counts"), what, hint, needs=needs)

    def _bounded(self, fields: Sequence[Field], path: Path, *, separators: int) -> list[Field]:
        """The fields; those without a bound are limited to the rest of the payload."""
        unbounded = {field.name for field in fields if (*path, field.name) in self._types.unbounded}
        bounded = [field for field in fields if field.name not in unbounded]
        return [
            self._filled(field, self._room(field, bounded) - separators, fields, path)
            if field.name in unbounded
            else field
            for field in fields
        ]

    def _room(self, field: Field, bounded: Sequence[Field]) -> int:
        """What the fields that may be present along with a field leave of the payload."""
        beside = [each for each in bounded if not exclusive(each.when, field.when)]
        # Records of variable size may leave more, and an encoder refuses what the frame does not allow.
        walked = sum(each.min_size for each in beside if each.walked)
        return self._payload_max - walked - greatest_size(each for each in beside if not each.walked)

    def _filled(self, field: Field, room: int, fields: Sequence[Field], path: Path) -> Field:
        kind, place = field.type, (*path, field.name)
        assert isinstance(kind, Blob | Array | Records)
        most = kind.items_in(max(0, room))
        counters = {each.name: each.type for each in fields if isinstance(each.type, Scalar)}
        counter = counters.get(kind.length.counted_by)
        if counter and isinstance(counter.role, Count):
            beside = sum(each.max_size for each in fields if each.name in counter.role.beside)
            limit = max(0, counter.maximum * counter.role.scale + counter.role.offset - beside)
            most = min(most, kind.items_in(limit) if counter.role.unit == "bytes" else limit)
        if most == 0:
            what = f"the payload has no room for {field.name}"
            hint = f"the frame allows {self._payload_max} bytes; shorten the other fields"
            self._report.error("payload-too-long", place, what, hint, of_key=True, needs=(path, ("frame",)))
            self._report.taint(place)
        return replace(field, type=replace(kind, length=replace(kind.length, maximum=max(1, most))))


def _is_sized(field: Field, counters: Collection[str], measured: Collection[str]) -> bool:
    """Whether a count tells the bytes of a choice, or of records of variable size.

    ``counters`` has what any count tells, ``measured`` the fields whose bytes one tells.
    """
    if field.slot:
        return field.slot in counters
    return field.walked and field.name in measured


def _with_counter(field: Field, counter: str | None) -> Field:
    kind = field.type
    if counter is None or not isinstance(kind, Blob | Array | Records) or kind.length.fixed:
        return field
    return replace(field, type=replace(kind, length=replace(kind.length, counted_by=counter)))


def _is_countable(kind: FieldType) -> bool:
    """Whether a count may tell the number of items, or their bytes."""
    if not isinstance(kind, Blob | Array | Records) or kind.length.fixed:
        return False
    return not isinstance(kind, Records) or not kind.last


def _is_row(kind: FieldType) -> bool:
    return isinstance(kind, Array) and kind.packed is not None
