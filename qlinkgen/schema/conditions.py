"""Second pass, conditions: which fields of a message may be absent, and what decides that."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from qlinkgen.model.condition import Condition, Test, exclusive, turning_points
from qlinkgen.model.fields import Field, Layout, Record, Records, Value, values_of
from qlinkgen.model.types import Array, Blob, Characters, Count, Enum, Float, Scalar
from qlinkgen.schema.file_fields import Fields
from qlinkgen.schema.frame_values import FrameValues
from qlinkgen.schema.location import Location
from qlinkgen.schema.notation import TestText, Wanted, shown
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.source import Path

_RULE = "bad-condition"
#: The hint where no field comes before.
_OWN = "name a field of the same message that comes before it"
_FRAME: Path = ("frame",)
_NO_VALUES = FrameValues()


class ConditionBuilder:
    """Adds the conditions to the fields of one message."""

    def __init__(
        self,
        specs: Fields,
        path: Path,
        report: Reporter,
        *,
        separated: bool = False,
        beside: FrameValues = _NO_VALUES,
    ) -> None:
        """``specs`` are the fields as written; ``separated``: texts between separators, any may be empty.

        ``beside`` are values of the frame.
        """
        self._separated = separated
        self._beside = beside
        self._specs = specs
        self._path = path
        self._report = report

    def build(self, fields: Sequence[Field]) -> list[Field]:
        """The fields with their conditions, checked against each other."""
        # Below, each field is compared with the others, which takes long for thousands of them.
        specs = [self._specs[field.name] for field in fields]
        if not any(field.walked for field in fields) and not any(s.when or s.optional for s in specs):
            return list(fields)
        found: list[Field] = []
        for field in fields:
            spec = self._specs[field.name]
            when = self._condition(field, spec.when or (), found)
            self._check_possible(field, when, found)
            given = not spec.optional and self._holds(when, found)
            found.append(replace(field, when=when, optional=spec.optional, given=given))
        self._check_cases(found)
        for field in () if self._separated else found:
            self._check(field, found)
            if any(each.conditional or each.walked for each in found) and _is_packed_run(field):
                name = field.slot or field.name
                what = f"{name} is packed and of variable size, beside fields whose place varies"
                hint = "give it a fixed number of items"
                self._report.error(_RULE, (*self._path, field.name), what, hint, of_key=True)
        return found

    def _error(self, field: str, key: str, what: str, hint: str) -> None:
        place = (*self._path, field)
        spec = self._specs.get(field)
        rule = _RULE if spec is None or spec.case is None else "bad-switch"
        self._report.error(rule, (*place, key), what, hint, of_key=True, needs=(place, self._path, _FRAME))

    # Conditions

    def _condition(self, field: Field, texts: Sequence[TestText], before: Sequence[Field]) -> Condition:
        return tuple(dict.fromkeys(test for text in texts for test in self._test(field, text, before)))

    def _test(self, field: Field, text: TestText, before: Sequence[Field]) -> Iterator[Test]:
        """The test of a value, after those that decide whether there is one."""
        value = self._tested(field, text, before)
        if value is None:
            return
        assert isinstance(value.type, Scalar)
        ranges = [self._range(field, each, value.type) for each in text.wanted]
        if None not in ranges:
            yield from value.field.when
            yield Test(value.name, tuple(each for each in ranges if each), text.negated)

    def _check_possible(self, field: Field, when: Condition, before: Sequence[Field]) -> None:
        """Check that no two tests exclude each other, and that the values tested can have such numbers."""
        for index, test in enumerate(when):
            if any(exclusive((other,), (test,)) for other in when[:index]):
                name = field.slot or field.name
                what = f"{name} is never present: its conditions on {test.value} exclude each other"
                key = "switch" if field.slot else "if"
                self._error(field.name, key, what, "remove one of them; those of a tested field apply too")
                return
        values = {} if field.slot else self._values(field, before)
        for name in dict.fromkeys(test.value for test in when if test.value in values):
            tested, tests = values[name].type, [test for test in when if test.value == name]
            assert isinstance(tested, Scalar)
            low, high = tested.minimum, tested.maximum
            raws = (raw for raw in {low, *turning_points(tests)} if low <= raw <= high)
            if not any(all(test.holds(raw) for test in tests) for raw in raws):
                what = f"{field.name} is never present: no {name} of {low}..{high} meets its conditions"
                hint = f"name values that {name} can have, or remove {field.name}"
                self._error(field.name, "if", what, hint)

    def _values(self, field: Field, before: Sequence[Field]) -> Mapping[str, Value]:
        """The values that a condition on a field may be about, by name."""
        found = (each for each in values_of(before) if each.field.slot != field.slot or not field.slot)
        return {**self._beside.known, **{value.name: value for value in found}}

    def _tested(self, field: Field, text: TestText, before: Sequence[Field]) -> Value | None:
        """The value that a condition names: of an earlier field, or of its bits."""
        key, values = "switch" if field.slot else "if", self._values(field, before)
        owner, _, bit = text.field.partition(".")
        value = values.get(bit or owner)
        if value is None and (barred := self._beside.barred.get(bit or owner)):
            self._error(field.name, key, *barred)
            return None
        if value is None or (bit and value.field.name != owner):
            known = f"earlier fields with a value: {listed(values)}" if values else _OWN
            hint = did_you_mean(text.field, values, known)
            what = f"{field.slot or field.name} has no field {shown(text.field)} with a value before it"
            self._error(field.name, key, what, hint)
            return None
        kind = value.type
        plain = (
            isinstance(kind, Scalar)
            and kind.scaling is None
            and not kind.bcd
            and kind.text is None
            and kind.integer.bits <= 64
        )
        if not plain or (isinstance(kind, Scalar) and isinstance(kind.meaning, Float | Characters)):
            what = f"what {field.slot} is" if field.slot else f"whether {field.name} is present"
            what = f"{text.field} cannot decide {what}"
            self._error(field.name, key, what, "name a whole number of up to 64 bits, an enum or a bool")
            return None
        if value.field.optional or value.field.slot:
            why = "may be left out" if value.field.optional else "has several types"
            what = f"{text.field} {why}"
            self._error(field.name, key, what, "name a field that is always present, or has an if")
            return None
        return value

    def _range(self, field: Field, wanted: Wanted, number: Scalar) -> tuple[int, int] | None:
        members = number.meaning.members if isinstance(number.meaning, Enum) else ()
        names = {member.name: member.value for member in members}
        if wanted.name and wanted.name not in names:
            hint = did_you_mean(wanted.name, names, "write a number, a range, true, false or a name")
            self._error(field.name, "if", f"{wanted.text} is not a value of the tested field", hint)
            return None
        if wanted.truth and number.meaning != "bool":
            what = f"{wanted.text} is not a value of the tested field, which is not a bool"
            self._error(field.name, "if", what, "write {FIELD: value}")
            return None
        first = names[wanted.name] if wanted.name else wanted.first
        last = names[wanted.name] if wanted.name else wanted.last
        if not number.minimum <= first <= last <= number.maximum:
            hint = f"use {number.minimum}..{number.maximum}"
            self._error(field.name, "if", f"{wanted.text} is outside the range of the tested field", hint)
            return None
        return first, last

    def _check_cases(self, fields: Sequence[Field]) -> None:
        """Check that the cases of each choice exclude each other, and that every value has one."""
        choices: dict[str, list[Field]] = {}
        for field in fields:
            if field.slot and field.when:
                choices.setdefault(field.slot, []).append(field)
        values = {value.name: value.type for value in (*self._beside.known.values(), *values_of(fields))}
        for slot, cases in choices.items():
            for index, case in enumerate(cases):
                other = next((each for each in cases[:index] if not exclusive(each.when, case.when)), None)
                if other is not None:
                    what = f"two cases of {slot} have values in common: {other.case} and {case.case}"
                    self._error(case.name, "if", what, "make them exclude each other")
            tested = values.get(cases[0].when[-1].value)
            assert isinstance(tested, Scalar)
            missing = self._unnamed(cases[0], tested)
            if missing is not None:
                what = f"{slot} has no case for {missing}, which {cases[0].when[-1].value} may be"
                hint = "add it, or default: bytes, or default: {} for no value"
                self._error(cases[0].name, "cases", what, hint)

    def _unnamed(self, case: Field, tested: Scalar) -> int | None:
        """A value of the tested field that has no case."""
        of = self._specs[case.name].case
        if of is None or of.named is None:
            return None
        ranges = [self._range(case, each, tested) for each in of.named]
        if None in ranges:
            return None
        test = Test("", tuple(each for each in ranges if each))
        raws = sorted({tested.minimum, *turning_points((test,))})
        inside = (raw for raw in raws if tested.minimum <= raw <= tested.maximum)
        return next((raw for raw in inside if not test.holds(raw)), None)

    def _holds(self, when: Condition, before: Sequence[Field]) -> bool:
        """Whether a condition holds for the defaults."""
        values = {value.name: value.type for value in (*self._beside.known.values(), *values_of(before))}
        kinds = [(test, values[test.value]) for test in when]
        return all(test.holds(kind.default) for test, kind in kinds if isinstance(kind, Scalar))

    # Checks

    def _check(self, field: Field, fields: Sequence[Field]) -> None:
        after = fields[fields.index(field) + 1 :]
        if field.optional:
            self._check_optional(field, after)
        counts = [each for each in fields if _counts(each) in (field.name, field.slot or field.name)]
        for count in () if field.slot else counts:
            if count.when != field.when or field.optional:
                what = f"{count.name} counts {field.name}, but one may be absent where the other is not"
                self._error(
                    field.name if field.conditional else count.name, "if", what, "give both the same if"
                )
        if not _is_run(field) or counts or (isinstance(field.type, Records) and field.type.last):
            return
        crossing = (each for each in after if each.conditional and not exclusive(field.when, each.when))
        if not field.optional and (later := next(crossing, None)):
            name = field.slot or field.name
            what = f"{name} takes the rest of the payload, but {later.name} after it may be absent"
            hint = f"give {name} a count"
            if later.when and later.when == field.when and not field.slot:
                hint += ", or put both into a record that has the if, or into a case of a switch"
            self._error(later.name, "optional" if later.optional else "if", what, hint)

    def _check_optional(self, field: Field, after: Sequence[Field]) -> None:
        if field.when:
            what, hint = f"{field.name} has a condition, so it is not optional", "remove one of them"
            self._error(field.name, "optional", what, hint)
        elif _is_run(field) or field.walked or not tuple(values_of((field,))):
            what = f"{field.name} cannot be optional"
            self._error(field.name, "optional", what, "use it on fields of fixed size that have a value")
        elif later := next((each for each in after if not each.optional), None):
            what = f"{later.name} follows {field.name}, which may be left out"
            hint = f"make {later.name} optional too, or move it before {field.name}"
            self._error(field.name, "optional", what, hint)


class EndBuilder(ConditionBuilder):
    """Builds the condition that the last record of an array meets."""

    def __init__(self, layout: Layout, location: Location) -> None:
        """``location`` is that of the array."""
        super().__init__({}, location.path, location.report)
        self._location = location
        self._layout = layout

    def tests(self, texts: Sequence[TestText]) -> Condition:
        """The tests of values of a record."""
        return tuple(test for text in texts for test in self._test(self._holder, text, self._layout.fields))

    @property
    def _holder(self) -> Field:
        return Field(f"the last {self._layout.name}", Record(self._layout))

    def _error(self, field: str, key: str, what: str, hint: str) -> None:  # noqa: ARG002 - as in the base
        what = what.replace(" with a value before it", " with a value")
        what = what.replace(f"whether {field} is present", f"which {self._layout.name} is the last one")
        hint = hint.replace("earlier fields", "fields")
        self._location.key_fault("bad-record", "last", what, hint)


def _counts(field: Field) -> str:
    """The field that a field counts, "" if it is not a count."""
    kind = field.type
    return kind.role.run if isinstance(kind, Scalar) and isinstance(kind.role, Count) else ""


def _is_packed_run(field: Field) -> bool:
    return isinstance(field.type, Array) and field.type.packed is not None and _is_run(field)


def _is_run(field: Field) -> bool:
    """Whether the number of items varies."""
    run = isinstance(field.type, Blob | Array | Records) and not field.type.length.fixed
    return run and not field.terminated
