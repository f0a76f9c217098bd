"""What a decoder's code is put together from: runs of fields of fixed size, and places for error texts."""

from __future__ import annotations

from dataclasses import dataclass, field

from qlinkgen.backends.python import scalars
from qlinkgen.backends.python.encode import MANY_ITEMS
from qlinkgen.backends.python.place import Place, items_span, joined_format, wrapped
from qlinkgen.model.message import Field, Message
from qlinkgen.model.types import Array, Blob


@dataclass
class Run:
    """Fields of fixed size in a row: formats, what they are unpacked into, what is then said of sizes."""

    codes: list[str] = field(default_factory=list)
    targets: list[str] = field(default_factory=list)
    after: list[str] = field(default_factory=list)
    size: int = 0
    items: Field | None = None

    def add(self, code: str, size: int, *targets: str) -> None:
        """Append a field."""
        self.codes.append(code)
        self.size += size
        self.targets.extend(targets)


@dataclass
class RunReader:
    """Collects statements: those that take the bytes apart in ``lines``, those that check values behind them.

    Attributes:
        lines: statements so far.
        constants: definitions that stand in front of the class.
    """

    message: Message
    place: Place
    title: str
    steps: dict[str, str]
    lines: list[str] = field(default_factory=list)
    constants: list[str] = field(default_factory=list)
    _run: Run = field(default_factory=Run)
    _runs: int = 0
    _late: list[str] = field(default_factory=list)
    _checks: list[str] = field(default_factory=list)
    _moved: bool = False
    _is_last: bool = False
    _fixed_at: int = 0
    _known: set[str] = field(default_factory=set)

    def _misfit(self, condition: str) -> None:
        self.lines += [f"if {condition}:", "    raise Misfit"]

    def _by_size(self, each: Field) -> bool:
        """There is a struct for each size of the message, and none for an impossible one."""
        kind = each.type
        return isinstance(kind, Array) and self._struct_items(kind) and kind.length.maximum <= MANY_ITEMS

    def _struct_items(self, kind: Array) -> bool:
        alone = len(self.message.variable) == 1
        return bool(scalars.letter(kind.item, self.place.names.byteorder)) and (alone or kind.length.fixed)

    # Runs

    def _start(self) -> str:
        """Where the run begins."""
        return "end" if self._moved else str(self._fixed_at)

    def _flush(self) -> None:
        """Write the run that has been collected."""
        run, self._run = self._run, Run()
        if run.targets:
            self._unpack(run)
        elif self._is_last and not self._moved and not self.message.variable:
            # Nothing to unpack: the size is all there is to check.
            size = self.message.max_size + self.place.overhead
            self._misfit(f"len({self.place.data}) != {size}" if size else self.place.data)
        self.lines += run.after
        if run.items is not None and not self._is_last:
            self._pass_items(run, run.items)
        elif not self._moved:
            self._fixed_at += run.size
        elif run.size:
            self.lines.append(f"end += {run.size}")

    def _pass_items(self, run: Run, items: Field) -> None:
        """Find the end of a run with items of any number: as far from the end of the data as what follows."""
        fixed = self.message.min_size - items.min_size + self.place.overhead
        behind = fixed - self._fixed_at - run.size
        self.lines.append(f"end = len({self.place.data}) - {behind}")
        self._moved = True

    def _unpack(self, run: Run) -> None:
        self._runs += 1
        name = f"_UNPACK_{self.title}" + (f"_{self._runs}" if self._runs > 1 else "")
        whole = len(self.message.variable) == int(run.items is not None) and self._is_last
        if whole and self.place.trailer:
            run.codes.append(f"{self.place.trailer}x")
        while not whole and run.codes[-1].endswith("x"):
            run.codes.pop()
        text = self.place.names.prefix + joined_format(run.codes)
        targets = ", ".join(run.targets) if len(run.targets) > 1 else f"{run.targets[0]},"
        # The whole message at once: then struct checks the size too.
        method = "unpack" if whole and self._fixed_at == 0 else "unpack_from"
        arguments = f"({self.place.data})" if method == "unpack" else f"({self.place.data}, {self._start()})"
        if run.items is not None:
            call = self._sized(name, text, run.items, method, arguments)
        else:
            self.constants.append(f'{name} = Struct("{text}").{method}')
            call = name + arguments
        self.lines += _unpacked(targets, run.targets, call)

    def _sized(self, name: str, text: str, items: Field, method: str, arguments: str) -> str:
        kind = items.type
        assert isinstance(kind, Array)
        length, place = kind.length, self.place
        if length.maximum > MANY_ITEMS:
            counted = text.replace("{n}", f"{{{items.name}_count}}")
            return f'{method}(f"{counted}", {arguments[1:]}'
        fixed = self.message.min_size - length.minimum * kind.item_size + place.overhead
        key = f"{fixed} + n * {kind.item_size}" if fixed else f"n * {kind.item_size}"
        span = items_span(length)
        self.constants.append(f'{name} = {{{key}: Struct(f"{text}").{method} for n in {span}}}')
        return f"{name}[len({place.data})]{arguments}"

    # Errors

    def _offset(self, each: Field) -> str:
        """Where a field begins in the payload: from its front, or negative from its end, or computed."""
        front = self.message.offset(each.name)
        if front is not None:
            return str(front)
        behind = self.message.fields[self.message.fields.index(each) :]
        if all(other.fixed for other in behind):
            return str(-sum(other.max_size for other in behind))
        return self._computed(each)

    def _computed(self, each: Field) -> str:
        """The place of a field behind others of variable size."""
        before = self.message.fields[: self.message.fields.index(each)]
        fixed = sum(other.max_size for other in before if other.fixed)
        terms = [str(fixed)] if fixed else []
        for other in before:
            if isinstance(other.type, Array | Blob) and not other.fixed:
                item = other.type.item_size
                terms.append(f"{other.name}_count" if item == 1 else f"{other.name}_count * {item}")
        return " + ".join(terms)

    def _illegal(self, name: str, seen: str, offset: str) -> str:
        return f'raise illegal(cls, "{name}", {seen}, {offset}, {self.place.payload})'


def _unpacked(joined: str, targets: list[str], call: str) -> list[str]:
    line = f"{joined} = {call}"
    if len(line) <= 100:
        return [line]
    return wrapped("(", targets, f") = {call}", 8)
