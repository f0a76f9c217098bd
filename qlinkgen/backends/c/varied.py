"""Generates the statements of records that are read one by one: of variable size, or up to a last one."""

from __future__ import annotations

from qlinkgen.backends.c import checks
from qlinkgen.backends.c.conditions import condition, numbers_of
from qlinkgen.backends.c.members import count_of, member_of
from qlinkgen.backends.c.names import count_type
from qlinkgen.model import naming
from qlinkgen.plan.openings import Inner, openings
from qlinkgen.plan.payload import CountStep, PayloadPlan, RecordsStep, RecordStep


def record_size(step: RecordStep | RecordsStep, function: str, value: str) -> str:
    """The size of one record in a struct; ``function`` is the prefix of its functions."""
    return f"{function}_size_(&{value})" if step.record.payload.walked else f"{step.record.size}U"


def size_lines(step: RecordStep | RecordsStep, function: str, total: str) -> list[str]:
    """Statements that add the size of the records of a struct to a local."""
    value = f"message->{member_of(step)}"
    if isinstance(step, RecordStep):
        return [f"{total} += {record_size(step, function, value)};"]
    most = f"{step.length.maximum}U"
    if not step.record.payload.walked:
        return [f"{total} += {step.record.size}U * (size_t)message->{count_of(step)};"]
    # The number has not been checked yet.
    test = f"index < {most}"
    if not step.fixed:
        test = f"({test}) && (index < (size_t)message->{count_of(step)})"
    return [
        f"for (size_t index = 0U; {test}; ++index) {{",
        f"    {total} += {record_size(step, function, f'{value}[index]')};",
        "}",
    ]


def is_sized(payload: PayloadPlan, name: str) -> bool:
    """Whether a count tells the bytes of walked records."""
    return any(isinstance(each, CountStep) and each.sized and each.run == name for each in payload.steps)


def is_counted(payload: PayloadPlan, name: str) -> bool:
    """Whether a count tells the number of walked records."""
    return any(isinstance(each, CountStep) and not each.sized and each.run == name for each in payload.steps)


def is_last(step: RecordsStep, value: str) -> str:
    """The condition that a record of a struct ends its array."""
    numbers = numbers_of(step.record.payload)
    return condition(step.last, numbers, lambda name: f"{value}.{naming.member(name)}")


def opened(step: RecordsStep, value: str) -> str:
    """The condition that a record of a struct takes all bytes that are left; "" if none does."""
    found = [" && ".join(f"({_inner(each, step, value)})" for each in tests) for tests in openings(step)]
    return " || ".join(f"({each})" for each in found) if len(found) > 1 else "".join(found)


def _inner(inner: Inner, step: RecordsStep, value: str) -> str:
    """The condition on a value of a record, or of one in it."""
    record = inner.inside[-1].record if inner.inside else step.record
    path = ".".join([value, *map(member_of, inner.inside)])
    return condition([inner.test], numbers_of(record.payload), lambda name: f"{path}.{naming.member(name)}")


class Reader:
    """Prints the statements that read walked records at the pointer ``payload``, before ``size`` bytes."""

    def __init__(self, function: str, upper: str) -> None:
        """``function`` is the prefix of the functions of the record, ``upper`` that of macros."""
        self._function = function
        self._upper = upper

    def one(self, step: RecordStep) -> list[str]:
        """A single record."""
        return ["{", *_indented(self._get(step, f"message->{member_of(step)}", ["size"])), "}"]

    def counted(self, step: RecordsStep, number: str, *, exact: str = "") -> list[str]:
        """So many records, which have ``exact`` bytes if that is given."""
        value = f"message->{member_of(step)}[index]"
        left = ["left", "size"] if exact else ["size"]
        loop = [
            *self._numbered(step, number),
            f"for (size_t index = 0U; index < {number}; ++index) {{",
            *_indented(self._get(step, value, left)),
            "}",
        ]
        if not exact:
            return loop
        return [
            "{",
            f"    size_t left = {exact};",
            "",
            *_indented([*loop, *checks.refusal(["left != 0U"], f"{self._upper}_ERROR_LENGTH")]),
            "}",
        ]

    def filled(self, step: RecordsStep, exact: str) -> list[str]:
        """The records in so many bytes."""
        value, least = f"message->{member_of(step)}[found]", step.length.minimum
        few = checks.refusal([f"found < {least}U"], f"{self._upper}_ERROR_LENGTH") if least else []
        return [
            "{",
            f"    size_t left = {exact};",
            "    size_t found = 0U;",
            "",
            "    while (left > 0U) {",
            *_indented([*self._bound(step), *self._get(step, value, ["left", "size"]), "++found;"], 2),
            "    }",
            *_indented([*few, *self._numbered(step, "found")]),
            "}",
        ]

    def ended(self, step: RecordsStep) -> list[str]:
        """The records up to the last one."""
        value = f"message->{member_of(step)}[found]"
        end = [f"ended = {is_last(step, value)};", "++found;"]
        return [
            "{",
            "    size_t found = 0U;",
            "    bool ended = false;",
            "",
            "    while (!ended) {",
            *_indented([*self._bound(step), *self._get(step, value, ["size"]), *end], 2),
            "    }",
            *_indented(self._numbered(step, "found")),
            "}",
        ]

    def _bound(self, step: RecordsStep) -> list[str]:
        return checks.refusal([f"found >= {step.length.maximum}U"], f"{self._upper}_ERROR_LENGTH")

    @staticmethod
    def _numbered(step: RecordsStep, number: str) -> list[str]:
        if step.fixed:
            return []
        kind = count_type(step.length.maximum)
        return [f"message->{count_of(step)} = ({kind}){number};"]

    def _get(self, step: RecordStep | RecordsStep, value: str, left: list[str]) -> list[str]:
        """Statements that read one record, whose bytes are subtracted from locals."""
        if step.record.payload.walked:
            lines = ["size_t taken = 0U;"]
            call = f"{self._function}_get_(&{value}, payload, {left[0]}, &taken)"
            used = "taken"
        else:
            used = f"{step.record.size}U"
            lines = []
            get = f"{self._function}_get_(&{value}, payload)"
            call = f"({left[0]} < {used}) ? (int){self._upper}_ERROR_LENGTH : {get}"
        return [
            *lines,
            f"const int status = {call};",
            "",
            f"if (status != (int){self._upper}_OK) {{",
            "    return status;",
            "}",
            f"payload += {used};",
            *(f"{each} -= {used};" for each in left),
        ]


def _indented(lines: list[str], level: int = 1) -> list[str]:
    return [f"{'    ' * level}{line}" if line else "" for line in lines]
