"""Second pass, arrays of integers with bits: each item of a named type with bits is a record of them."""

from __future__ import annotations

from collections.abc import Mapping

from qlinkgen.schema.file_fields import FieldSpec, RecordSpec
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.layouts import layouts
from qlinkgen.schema.notation import TypeText, type_text


def bit_types(file: SchemaFile) -> Mapping[str, RecordSpec]:
    """The records of items of the named types with bits, by the name of the type."""
    found: dict[str, RecordSpec] = {}
    for name, spec in file.types.items():
        if isinstance(spec, FieldSpec) and _has_bits(file, spec):
            fields = {name: FieldSpec(type=name)}
            found[name] = RecordSpec(
                fields=fields, doc=spec.doc, section=spec.section, confirmed=spec.confirmed
            )
    return found


def items_of(file: SchemaFile) -> frozenset[str]:
    """The named types with bits that are items of an array in the file."""
    known = bit_types(file)
    specs = (spec for layout in layouts(file) for spec in layout.fields.values()) if known else ()
    texts = (text for spec in specs if (text := _text(spec)) is not None)
    return frozenset(text.base for text in texts if text.count is not None and text.base in known)


def _has_bits(file: SchemaFile, spec: FieldSpec) -> bool:
    seen = set[str]()
    while spec.bits is None:
        text = _text(spec)
        below = file.types.get(text.base) if text and text.count is None and text.base not in seen else None
        if text is None or not isinstance(below, FieldSpec):
            return False
        seen.add(text.base)
        spec = below
    text = _text(spec)
    return text is not None and text.count is None


def _text(spec: FieldSpec) -> TypeText | None:
    try:
        return type_text(spec.type)
    except ValueError:
        return None
