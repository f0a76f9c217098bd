"""Second pass, hosts: how the host of one device comes back in step, and what its commands act on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from qlinkgen.model.frame import Frame, PacketFrame
from qlinkgen.model.transaction import Command, Resync, Selection
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.notation import shown
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.sides import refuse_classes
from qlinkgen.schema.source import Path

_RULE = "bad-resync"
_RESYNC: Path = ("bus", "resync")
_SELECT: Path = ("bus", "select")


def resync_of(file: SchemaFile) -> Resync | None:
    """How the host of the file comes back in step; None if it does not say so."""
    spec = file.bus.resync
    return None if spec is None else Resync(spec.command, spec.fill, MappingProxyType(spec.fills))


def selection_of(file: SchemaFile) -> Selection | None:
    """What commands of the file act on; None if it does not say so."""
    spec = file.bus.select
    if spec is None:
        return None
    commands = {number: name for name, number in spec.commands.items()}
    return Selection(spec.attribute, tuple(spec.values), MappingProxyType(commands), tuple(spec.lost_by))


class HostChecker:
    """Checks what the bus says of a host against its commands."""

    def __init__(
        self, file: SchemaFile, frame: Frame | None, commands: Sequence[Command], report: Reporter
    ) -> None:
        self._file, self._frame, self._report = file, frame, report
        self._commands: Mapping[str, Command] = {each.name: each for each in commands}

    def run(self) -> None:
        """Report what does not fit."""
        for path, spec in ((_RESYNC, self._file.bus.resync), (_SELECT, self._file.bus.select)):
            if spec is not None and self._file.bus.kind != "host":
                what, hint = f"only a host has {path[-1]}", "use kind: host, or remove it"
                self._error(path, what, hint, ("bus", "kind"), of_key=True)
                return
        self._check_resync()
        self._check_selection()

    def _check_resync(self) -> None:
        spec, frame = self._file.bus.resync, self._frame
        if spec is None or frame is None:
            return
        if not isinstance(frame, PacketFrame) or frame.checksum is None:
            what = "without a check value in its answers a host does not notice that it is out of step"
            hint = "add a part with role: checksum to a packet, or remove it"
            self._error(_RESYNC, what, hint, ("frame",), of_key=True)
            return
        self._sent_alone((*_RESYNC, "command"), spec.command, reads=True)
        self._known((*_RESYNC, "fills"), spec.fills)
        for path, fill in ((("fill",), spec.fill), *((("fills", name), b) for name, b in spec.fills.items())):
            taken = next((each for each in self._commands.values() if each.id == fill), None)
            if taken is not None:
                what = f"{fill:#04x} is the id of {taken.name}, which a device in step would execute"
                self._error((*_RESYNC, *path), what, "use a byte that is not an id", ("commands",))

    def _check_selection(self) -> None:
        spec = self._file.bus.select
        if spec is None:
            return
        place = (*_SELECT, "attribute")
        declared = self._file.attributes.get(spec.attribute)
        if declared is None:
            what = f"attribute {shown(spec.attribute)} is not declared"
            hint = did_you_mean(spec.attribute, self._file.attributes, "declare it under attributes")
            self._error(place, what, hint, ("attributes",))
        for index, value in enumerate(spec.values if declared is not None and declared.values else ()):
            assert declared is not None
            allowed = declared.values or []
            if value not in allowed:
                words = [shown(each).strip("'") for each in allowed]
                hint = did_you_mean(str(value), words, f"use {listed(words, 'or')}")
                what = f"{spec.attribute} cannot be {shown(value)}"
                self._error((*_SELECT, "values", index), what, hint, ("attributes",))
        seen: dict[int, str] = {}
        for name, number in spec.commands.items():
            place = (*_SELECT, "commands", name)
            self._sent_alone(place, name, reads=False)
            if number in seen:
                what = f"{name} selects {number}, and so does {seen[number]}"
                self._error(place, what, "give each another number")
            seen[number] = name
        self._known((*_SELECT, "lost_by"), spec.lost_by)
        name = spec.attribute
        refuse_classes(self._file, {name, f"{name}_calls"}, f"one {name}", self._report)
        if name in self._commands:
            what = f"{name} is also the method of generated Python that selects"
            self._report.error("name-clash", ("commands", name), what, "rename it", of_key=True)

    def _known(self, path: Path, names: Mapping[str, int] | Sequence[str]) -> None:
        """Check that names are those of commands."""
        for index, name in enumerate(names):
            if name not in self._commands:
                place, of_key = (
                    ((*path, name), True) if isinstance(names, Mapping) else ((*path, index), False)
                )
                self._unknown(place, name, of_key=of_key)

    def _unknown(self, place: Path, name: str, *, of_key: bool) -> None:
        hint = did_you_mean(name, self._commands, f"its commands are {listed(self._commands)}")
        self._error(place, f"unknown command {shown(name)}", hint, ("commands", name), of_key=of_key)

    def _sent_alone(self, place: Path, name: str, *, reads: bool) -> None:
        """Check a command that the host sends of itself: to see that it is in step, or to select."""
        command, of_key = self._commands.get(name), not reads
        if command is None:
            self._unknown(place, name, of_key=of_key)
            return
        why = ""
        if command.request.fields:
            why = "its request has data"
        elif command.response is None:
            why = "it has no response"
        elif reads and not command.repeat.safe:
            why = "it may not be repeated"
        if why:
            end = "show that host and device are in step" if reads else "select"
            hint = f"use a command without data {'that reads' if reads else 'and with a response'}"
            self._error(place, f"{name} cannot {end}: {why}", hint, ("commands", name), of_key=of_key)

    def _error(self, place: Path, what: str, hint: str, *needs: Path, of_key: bool = False) -> None:
        self._report.error(_RULE, place, what, hint, of_key=of_key, needs=(place, *needs))
