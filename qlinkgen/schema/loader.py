"""Loads a schema file and returns its model, or its faults."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path as FilePath

from qlinkgen.errors import Fault, SchemaError
from qlinkgen.model.frame import Frame, FrameKinds
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.replacement import Replacement
from qlinkgen.model.texts import schema_hash
from qlinkgen.schema.addresses import check_addresses
from qlinkgen.schema.asked import check_told
from qlinkgen.schema.commands import CommandBuilder, build_bus
from qlinkgen.schema.echoes import EchoBuilder
from qlinkgen.schema.examples import build_examples
from qlinkgen.schema.fields import FieldBuilder
from qlinkgen.schema.frame_kinds import begun, build_kinds, check_used
from qlinkgen.schema.frames import FrameBuilder, payload_bounds
from qlinkgen.schema.including import include
from qlinkgen.schema.kind_messages import message_builder
from qlinkgen.schema.kind_names import check_kind_names
from qlinkgen.schema.names import check_names
from qlinkgen.schema.notation import Version
from qlinkgen.schema.notation import version as as_version
from qlinkgen.schema.part_types import place_part_types
from qlinkgen.schema.reading import read_regular, reason_of
from qlinkgen.schema.replaced import with_check
from qlinkgen.schema.report import Reporter
from qlinkgen.schema.response_forms import with_forms
from qlinkgen.schema.seeds import check_references, check_types
from qlinkgen.schema.shared_proofs import with_shared_proofs
from qlinkgen.schema.source import Data, parse
from qlinkgen.schema.structure import check_structure
from qlinkgen.schema.switches import without_choices
from qlinkgen.schema.terminators import check_terminator
from qlinkgen.schema.text_ids import check_text_ids
from qlinkgen.schema.types import TypeBuilder
from qlinkgen.schema.unconfirmed import report_unconfirmed
from qlinkgen.schema.unknown import UnknownBuilder
from qlinkgen.schema.versions import FIRST, boundaries, check_lifetimes, in_version

_AS_WRITTEN = Replacement()


def lint(path: FilePath | str, *, version: str | None = None) -> list[Fault]:
    """All errors and warnings of a schema file, in order of the text.

    Args:
        path: The file.
        version: Version of the protocol; by default the newest one, and the errors of each other one.
    """
    faults = _load(FilePath(path), _AS_WRITTEN, version)[1]
    if version is None:
        for other in _versions(FilePath(path), faults):
            found = _load(FilePath(path), _AS_WRITTEN, str(other))[1]
            known = {(fault.rule, fault.line, fault.column) for fault in faults}
            faults += [
                replace(fault, message=f"{fault.message} in version {other} of the protocol")
                for fault in found
                if fault.severity == "error"
                and (fault.rule, fault.line, fault.column) not in known
                # Before its first version a protocol may be empty.
                and not (fault.rule == "empty-protocol" and other == FIRST)
            ]
    return sorted(faults)


def _versions(path: FilePath, faults: Sequence[Fault]) -> tuple[Version, ...]:
    """Versions of a protocol other than the newest one; none if the file has an error."""
    if any(fault.severity == "error" for fault in faults):
        return ()
    source = parse(read_regular(path))
    report = Reporter(str(path), source)
    include(source, report)
    place_part_types(source, report)
    file = check_structure(source.data, report)
    return boundaries(file) if file else ()


def load(
    path: FilePath | str, *, crc: str | None = None, crc_over: Sequence[str] = (), version: str | None = None
) -> Protocol:
    """Read a schema file.

    Args:
        path: The file.
        crc: Algorithm that replaces the one in the file.
        crc_over: Parts that its check value covers, in place of those in the file.
        version: Version of the protocol; by default the newest one.

    Raises:
        SchemaError: with all errors of the file.
    """
    protocol, faults = _load(FilePath(path), Replacement(crc, tuple(crc_over)), version)
    errors = [fault for fault in faults if fault.severity == "error"]
    if protocol is None or errors:
        raise SchemaError(errors)
    return protocol


def loads(
    text: str,
    file: str,
    *,
    crc: str | None = None,
    crc_over: Sequence[str] = (),
    version: str | None = None,
) -> tuple[Protocol | None, list[Fault]]:
    """The protocol described by a text (None if it has errors), and its faults; see `load`."""
    return _loads(text, file, Replacement(crc, tuple(crc_over)), version)


def _loads(
    text: str, file: str, check: Replacement, version: str | None
) -> tuple[Protocol | None, list[Fault]]:
    source = parse(text)
    report = Reporter(file, source)
    for fault in source.faults:
        report.at(fault.rule, fault.position, fault.message, fault.hint)
    if any(fault.rule == "yaml-syntax" for fault in source.faults):
        return None, report.faults
    texts = (text, *include(source, report))
    place_part_types(source, report)
    chosen = None if version is None else as_version(version)
    protocol = _build(source.data, report, "".join(texts), FilePath(file).name, check, version=chosen)
    return protocol if not report.failed else None, report.faults


def _load(path: FilePath, check: Replacement, version: str | None) -> tuple[Protocol | None, list[Fault]]:
    try:
        text = read_regular(path)
    except (OSError, UnicodeDecodeError) as error:
        what = f"cannot read it: {reason_of(error)}"
        return None, [Fault(str(path), 1, 1, "file-unreadable", what, "check the path")]
    return _loads(text, str(path), check, version)


def _build(
    data: Data, report: Reporter, text: str, file_name: str, check: Replacement, *, version: Version | None
) -> Protocol | None:
    whole = check_structure(data, report)
    if whole is None:
        return None
    whole = without_choices(whole, report)
    check_lifetimes(whole, report)
    file = with_shared_proofs(with_forms(in_version(whole, version), report))
    if check != _AS_WRITTEN:
        file = with_check(file, check, report)
    text += f"\nversion {version}" if version else ""
    payload_max = payload_bounds(file)[1]
    types = TypeBuilder(file, report, payload_max)
    frames = FrameBuilder(file, report, types)
    frame: Frame | None = build_kinds(file, frames, report) if file.frames else frames.build()
    check_kind_names(file, report)
    bus = build_bus(file, report)
    check_types(file, report)
    check_references(file, report, frame)
    check_addresses(frame, bus, file.bus.master, report)
    FieldBuilder(file, report, types, payload_max).check_records()
    messages = message_builder(file, report, types, frame, bus)
    commands = CommandBuilder(file, report, messages, frame, bus)
    commands.build()
    if isinstance(frame, FrameKinds):
        check_used(file, frame, commands.messages, report)
        frame = begun(frame, commands.messages, report)
    transactions = EchoBuilder(file, frame, messages.places, report).build(commands.commands)
    check_terminator(frame, commands.messages, report)
    check_text_ids(commands.messages, messages.id_places, report)
    types.report_unused()
    check_names(file, frame, commands.messages, messages.places, report)
    report_unconfirmed(file, report)
    if frame is None or report.failed:
        return None
    spec = file.protocol
    protocol = Protocol(
        name=spec.name,
        title=spec.title or spec.name,
        revision=spec.revision,
        source=spec.source,
        doc=spec.doc,
        byteorder=file.byteorder,
        enums=tuple(types.enums.values()),
        flags=tuple(types.flags.values()),
        frame=frame,
        bus=bus,
        commands=tuple(transactions),
        messages=tuple(commands.messages),
        schema_hash=schema_hash(text),
        schema_file=file_name,
        includes=file.include or "",
        version=str(version) if version else "",
    )
    protocol = replace(protocol, to_unknown=UnknownBuilder(file, report, frame, transactions).build())
    check_told(protocol, messages.id_places, report)
    # With another checksum, or in another version, the bytes of the document are wrong.
    examples = build_examples(file, protocol, report) if check == _AS_WRITTEN and version is None else ()
    return replace(protocol, examples=examples)
