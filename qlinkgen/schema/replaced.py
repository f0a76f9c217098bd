"""First pass, another check value than the one in the file."""

from __future__ import annotations

from collections.abc import Mapping

from qlinkgen.model.replacement import Replacement
from qlinkgen.schema.file_frames import PartSpec
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.frames import with_payload
from qlinkgen.schema.report import Reporter


def with_check(file: SchemaFile, other: Replacement, report: Reporter) -> SchemaFile:
    """The file with another algorithm or coverage of the check value of each frame."""
    if file.frames:
        kinds = {
            name: kind.model_copy(update={"parts": _parts(kind.parts, other)})
            for name, kind in file.frames.items()
        }
        return file.model_copy(update={"frames": kinds})
    frame, changed = file.frame, {}
    if frame.parts is not None:
        changed["parts"] = _parts(frame.parts, other)
    elif frame.marked is not None and frame.marked.checksum is not None:
        checked = _spec(frame.marked.checksum, other)
        return _with_frame(file, {"marked": frame.marked.model_copy(update={"checksum": checked})})
    elif frame.packet is not None:
        if other.over:
            what = "the check value of a packet covers all of it"
            report.error("not-applicable", ("frame", "packet"), what, "omit the option", of_key=True)
        changed["packet"] = _parts(frame.packet, Replacement(other.algorithm))
    return _with_frame(file, changed)


def _with_frame(file: SchemaFile, changed: Mapping[str, object]) -> SchemaFile:
    return file.model_copy(update={"frame": file.frame.model_copy(update=dict(changed))})


def _parts(specs: Mapping[str, PartSpec], other: Replacement) -> Mapping[str, PartSpec]:
    main = _main_check(with_payload(specs))
    return {name: _spec(spec, other) if name == main else spec for name, spec in specs.items()}


def _main_check(specs: Mapping[str, PartSpec]) -> str:
    """The check value that can be replaced: the last over the payload, else the last."""
    checks = [
        name
        for name, spec in specs.items()
        if spec.told == "checksum" and not spec.every and not _depends(spec)
    ]
    payload = next((name for name, spec in specs.items() if spec.told == "payload"), "")
    over = [name for name in checks if payload in (specs[name].over or ())]
    return (over or checks or [""])[-1]


def _depends(spec: PartSpec) -> bool:
    """Whether only some frames of a direction have a part."""
    return any(test.field != "direction" for test in spec.when or ())


def _spec(spec: PartSpec, other: Replacement) -> PartSpec:
    changed: dict[str, object] = {}
    if other.algorithm is not None:
        changed = {"algorithm": other.algorithm, "init": None}
    if other.over:
        changed["over"] = list(other.over)
    return spec.model_copy(update=changed)
