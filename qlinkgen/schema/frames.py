"""Second pass, frames: builds one of the three kinds of frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from qlinkgen.model import checksum as catalogue
from qlinkgen.model.frame import ATTRIBUTE, Checksum, DelimitedFrame, Frame, MarkedFrame, PacketFrame, Part
from qlinkgen.model.types import Chunk, Scalar
from qlinkgen.schema.bit_directions import check_counters, each_way
from qlinkgen.schema.coding import CodingBuilder
from qlinkgen.schema.file_frames import FrameSpec, KindSpec, MarkedSpec, PartSpec
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.kinds import MAX_PAYLOAD
from qlinkgen.schema.notation import beyond
from qlinkgen.schema.part_conditions import PartConditions, check_conditions
from qlinkgen.schema.part_digits import check_kind
from qlinkgen.schema.part_directions import check_directions
from qlinkgen.schema.part_texts import without_end
from qlinkgen.schema.parties import with_parties
from qlinkgen.schema.parts import PartBuilder
from qlinkgen.schema.pieces import MAX_ID_BITS, placed
from qlinkgen.schema.report import Reporter, listed
from qlinkgen.schema.source import Path
from qlinkgen.schema.stuffing import build_stuffing, check_unique
from qlinkgen.schema.terminators import check_terminator_part
from qlinkgen.schema.text_ids import coding_without, with_text_id, without_text_id
from qlinkgen.schema.types import TypeBuilder

_KINDS = ("parts", "marked", "packet")
_PACKET_ROLES = ("message", "payload", "checksum")


def payload_bounds(file: SchemaFile) -> tuple[int, int]:
    """Minimum and maximum payload size of the frame; the widest bounds if it states none."""
    if file.frame.marked is not None:
        return file.frame.marked.payload
    groups = [{**(file.frame.parts or {}), **(file.frame.packet or {})}]
    if file.frames:
        groups = [kind.parts for kind in file.frames.values()]
    parts = [part for group in groups for part in group.values() if part.told == "payload"]
    sizes = [part.size for part in parts if part.size]
    if not sizes:
        return 0, MAX_PAYLOAD
    return min(low for low, _ in sizes), max(high for _, high in sizes)


def with_payload(specs: Mapping[str, PartSpec]) -> Mapping[str, PartSpec]:
    """The parts of a kind of frame, with an empty payload before its check values if it has none."""
    if any(spec.told == "payload" for spec in specs.values()):
        return specs
    name = "payload"
    while name in specs:
        name += "_"
    names = list(specs)
    at = 1 + max(
        (index for index, each in enumerate(names) if specs[each].told not in ("constant", "checksum")),
        default=0,
    )
    payload = PartSpec.model_validate({"role": "payload", "size": 0})
    return {**{each: specs[each] for each in names[:at]}, name: payload, **{e: specs[e] for e in names[at:]}}


class FrameBuilder:
    """Builds the frame of one file."""

    def __init__(self, file: SchemaFile, report: Reporter, types: TypeBuilder) -> None:
        """``types`` are those of values."""
        self._file = file
        self._report = report
        self._parts = PartBuilder(file, report, types)

    def build(self) -> Frame | None:
        """The frame; None after an error that prevents building it."""
        frame = self._build()
        if frame is None:
            self._report.taint(("frame",))
        return frame

    def kind(self, name: str, spec: KindSpec) -> DelimitedFrame | None:
        """One of several kinds of frame; None after an error that prevents building it."""
        frame = self._delimited(spec, with_payload(spec.parts), ("frames", name, "parts"))
        if frame is None:
            self._report.taint(("frames", name))
        return frame

    def _build(self) -> Frame | None:
        spec = self._file.frame
        if "frame" not in self._file.model_fields_set:
            what = "key 'frame' is missing"
            hint = "frame: the frame around each message; or frames: kinds of frame by name"
            self._report.error("missing-key", (), what, hint, of_key=True, absent=True)
            return None
        given = [key for key in _KINDS if getattr(spec, key) is not None]
        if len(given) != 1:
            what = (
                f"the frame has {listed(given)}"
                if given
                else "the frame has neither parts nor marked nor packet"
            )
            hint = "a frame is described by exactly one of parts, marked and packet"
            if not any(self._report.touched(("frame", key)) for key in _KINDS):
                self._report.error("bad-frame", ("frame",), what, hint, of_key=True, absent=True)
            return None
        if spec.stuffing is not None and spec.parts is None:
            what = "'stuffing' applies only to frames of parts"
            self._parts.fault("not-applicable", ("frame", "stuffing"), what, "remove it")
        if spec.coding is not None and spec.parts is None:
            what = "'coding' applies only to frames of parts"
            self._parts.fault("not-applicable", ("frame", "coding"), what, "remove it")
        others: list[tuple[Path, PartSpec]] = [
            (("packet", name), each) for name, each in (spec.packet or {}).items()
        ]
        if spec.marked and spec.marked.checksum:
            others.append((("marked", "checksum"), spec.marked.checksum))
        for place, each in others:
            if each.when is not None:
                what = "'if' applies only to frames of parts"
                self._parts.fault("not-applicable", ("frame", *place, "if"), what, "remove it")
        if spec.parts is not None:
            return self._delimited(spec, spec.parts, ("frame", "parts"))
        return self._marked(spec.marked) if spec.marked is not None else self._packet(spec.packet or {})

    # Parts in wire order

    def _delimited(
        self, spec: FrameSpec | KindSpec, specs: Mapping[str, PartSpec], path: Path
    ) -> DelimitedFrame | None:
        if not self._parts.roles_fit(specs, ("payload",), path):
            return None
        silences = [name for name, part in specs.items() if part.told in {"idle", "break"}]
        idle = silences[0] if silences else ""
        for name in silences[1:]:
            what = f"{idle} and {name} both end a frame"
            self._parts.fault("bad-frame", (*path, name), what, "remove one of them")
        silence = self._parts.silence(specs[idle], (*path, idle), names=[*specs]) if idle else None
        given = specs
        specs, opening = without_text_id(specs, path, self._report)
        specs = {name: part for name, part in specs.items() if name not in silences}
        parts = placed(
            tuple(self._parts.build(name, part, specs, (*path, name)) for name, part in specs.items())
        )
        if opening:
            self._parts.check_opening(given[opening], (*path, opening))
        parts = with_text_id(parts, opening, given.get(opening))
        parts = PartConditions(specs, path, self._report).added(parts)
        if not isinstance(spec, FrameSpec):
            check_kind(specs, path, self._report)
        stuffed = spec.stuffing if isinstance(spec, FrameSpec) else None
        coded_as = coding_without(spec.coding, opening)
        alone = bool(silence and silence.alone)
        coding = CodingBuilder(parts, self._parts, self._report, path[:-1], silent=alone).build(coded_as)
        if stuffed:
            self._check_stuffing(parts, path, alone=alone, coded=coded_as is not None)
            insert, names, after = build_stuffing(stuffed, parts, self._parts, self._report)
            coding = (insert,), names, after
        if opening and coding[2]:
            what = f"{opening} has several lengths, but only the payload is stuffed"
            hint = "stuff the finished frame, or give ids one length"
            self._report.error("bad-text-id", (*path, opening), what, hint, of_key=True)
        parts = without_end(parts, coding[1] if coding[0] else (), path, self._report)
        check_counters(parts, path, self._report)
        resolved = with_parties(parts, self._file, path, self._report)
        if resolved is None:
            return None
        resolved = each_way(resolved)
        whole = DelimitedFrame(resolved, *coding, silence, spec.doc, spec.section)
        if not all(self._fits(whole.towards(each), path) for each in whole.ways):
            return None
        if whole.directed:
            check_directions(whole, specs, path, self._report)
        return whole

    def _fits(self, frame: DelimitedFrame, path: Path) -> bool:
        """Check the frame of a direction; return whether more can be built on it."""
        self._check_pieces(frame, path)
        self._check_order(frame, path)
        self._check_empty(frame, path)
        for part in frame.parts:
            if part.checksum and part.checksum.every:
                self._check_blocks(frame, part, path)
        if frame.payload.trim is not None:
            self._check_trim(frame, frame.payload.trim, path)
        if self._is_circular(frame, path):
            return False
        self._check_length(frame, path)
        check_conditions(frame, path, self._report)
        stated = "coding" if self._file.frames or self._file.frame.coding is not None else "stuffing"
        check_unique(frame, (*path[:-1], stated), self._report)
        check_terminator_part(frame, path, self._report)
        if frame.ends_idle:
            self._check_idle(frame, path)
        return True

    def _check_idle(self, frame: DelimitedFrame, path: Path) -> None:
        """Check that nothing but an idle line ends a frame, if the file says so."""
        for part in frame.parts:
            if part.role in ("length", "terminator"):
                what = f"{part.name} tells the end of a frame as well"
                hint = f"remove alone: true, or {part.name}"
                self._parts.fault("bad-frame", (*path, part.name), what, hint)
        if not frame.payload.min_size and not any(part.size for part in frame.parts):
            what = "a frame may have no byte, which a receiver cannot tell from silence"
            self._parts.fault("bad-frame", (*path, frame.payload.name), what, "write size: 1..8")

    def _check_stuffing(self, parts: Sequence[Part], path: Path, *, alone: bool, coded: bool) -> None:
        """Check that the notation of stuffing is not used for another coding, or beside one."""
        end = next((part.name for part in parts if part.role == "terminator"), "")
        place, hint = ("frame", "stuffing"), "write coding: {insert: 00, after: A5}"
        what = "stuffing cannot be combined with a terminator" if end else ""
        if alone and not end:
            what = "stuffing does not apply to frames that only an idle line or a break ends"
        elif coded and not end:
            what, hint = "coding says the same as stuffing", "remove one of them"
        if what:
            needs = ((*path, end),) if end else ()
            self._report.error("not-applicable", place, what, hint, of_key=True, needs=needs)

    def _check_order(self, frame: DelimitedFrame, path: Path) -> None:
        """Check that what determines the end precedes the payload."""
        names = [part.name for part in frame.parts]
        payload = names.index(frame.payload.name)
        measured = frame.part("length") is None and not frame.ends_idle
        for index, part in enumerate(frame.parts):
            identifies = measured and any(bits.is_id for bits in part.bits)
            if (part.role == "length" or identifies) and index > payload:
                what, hint = f"{part.name} follows the payload", "move it before the payload"
                if identifies:
                    what = f"{what}, whose size follows from it"
                self._parts.fault("bad-frame", (*path, part.name), what, hint)

    def _check_blocks(self, frame: DelimitedFrame, part: Part, path: Path) -> None:
        """Check that check values of blocks follow the payload, whose size a length gives."""
        assert part.checksum is not None
        names = [each.name for each in frame.parts]
        payload, length = frame.payload.name, frame.part("length")
        others = [each for each in frame.parts if each.checksum and each is not part]
        beside = [
            each.name
            for each in others
            if {payload, part.name} & set(each.checksum.over if each.checksum else ())
        ]
        wrong = [
            (
                part.checksum.over != (payload,),
                f"{part.name} does not cover the payload alone",
                f"write over: [{payload}]",
            ),
            (
                names[names.index(payload) + 1 :][:1] != [part.name],
                f"{part.name} does not follow {payload}",
                "move it there",
            ),
            (length is None or payload not in length.counts, "no length counts the payload", "add one"),
            (
                length is not None and part.name in length.counts,
                f"a length counts {part.name}",
                f"count {payload} alone",
            ),
            (frame.stuffing is not None, "the frame is stuffed", "remove the stuffing or every"),
            (frame.coding != (), "the frame is coded", "remove the coding or every"),
            (frame.part("terminator") is not None, "the frame has a terminator", "remove it or every"),
            (
                bool(beside),
                f"{', '.join(beside)} covers the payload or its check values, too",
                "cover other parts",
            ),
            (part.checksum.otherwise is not None, f"{part.name} has a value for nothing", "remove otherwise"),
        ]
        for is_wrong, what, hint in wrong:
            if is_wrong:
                self._report.error("check-blocks", (*path, part.name, "every"), what, hint, of_key=True)
                return

    def _check_trim(self, frame: DelimitedFrame, keep: int, path: Path) -> None:
        """Check that a length gives the size of a payload without the zeros at its end."""
        payload, length = frame.payload, frame.part("length")
        counted = length.name if length else ""
        copies = [each.name for each in frame.parts if each.derivation and each.derivation.of == counted]
        blocks = [each.name for each in frame.parts if each.checksum and each.checksum.every]
        wrong = [
            (length is None or payload.name not in length.counts, "no length counts the payload", "add one"),
            (frame.length_scale > 1, "a length in steps cannot state every size", "remove scale or trim"),
            (bool(copies), f"{listed(copies)} repeats the length", "remove it or trim"),
            (bool(blocks), f"{listed(blocks)} has values for blocks of the payload", "remove every or trim"),
            (frame.stuffing is not None, "the frame is stuffed", "remove the stuffing or trim"),
            (frame.coding != (), "the frame is coded", "remove the coding or trim"),
            (frame.part("terminator") is not None, "the frame has a terminator", "remove it or trim"),
            (
                keep < payload.min_size,
                f"{keep} kept bytes are fewer than the {payload.min_size} of the shortest payload",
                f"write keep: {payload.min_size}, or size: 0..{payload.max_size}",
            ),
        ]
        for is_wrong, what, hint in wrong:
            if is_wrong:
                self._report.error("bad-trim", (*path, payload.name, "trim"), what, hint, of_key=True)
                return

    def _check_empty(self, frame: DelimitedFrame, path: Path) -> None:
        """Check that what a value for empty parts covers may be empty."""
        for part in frame.parts:
            if part.checksum and part.checksum.otherwise is not None:
                over = [each for each in part.checksum.over if each != frame.payload.name]
                if over or frame.payload.min_size:
                    what = (
                        f"{part.name} covers {over[0] if over else frame.payload.name}, which is never empty"
                    )
                    hint = "remove otherwise, or cover the payload alone"
                    self._parts.fault("not-applicable", (*path, part.name, "otherwise"), what, hint)

    def _is_circular(self, frame: DelimitedFrame, path: Path) -> bool:
        """Report check values that cover each other."""
        left = {part.name: part.checksum.over for part in frame.parts if part.checksum}
        while free := [name for name, over in left.items() if left.keys().isdisjoint(over)]:
            left = {name: over for name, over in left.items() if name not in free}
        if left:
            name = next(iter(left))
            what = f"the check values {listed(left)} cover each other"
            place, hint = (*path, name, "over"), "omit one of them from over"
            self._report.error("check-cycle", place, what, hint, of_key=True)
        return bool(left)

    def _check_pieces(self, frame: DelimitedFrame, path: Path) -> None:
        """Check the size of the message id, and of derived numbers."""
        parts = {part.name: part for part in frame.parts}
        if sum(bits.bits for bits in frame.id_bits) > MAX_ID_BITS:
            what = f"{listed([bits.name for bits in frame.id_bits])} have more than {MAX_ID_BITS} bits"
            self._parts.fault("bad-frame", path, what, "give some of them other roles")
        for part in frame.parts:
            if part.derivation and part.derivation.of not in parts:
                continue  # reported with the conditions
            source = parts[part.derivation.of] if part.derivation else part
            numeric = source.scalar is not None and source.role != "derived"
            if part.derivation and not (numeric and part.scalar and source.size == part.size):
                what = f"{part.name} cannot equal {source.name}"
                hint = "use a number of the same size that is not derived itself"
                self._report.error("bad-frame", (*path, part.name, "equals"), what, hint)
            elif part.derivation and source.role == "length" and frame.checked_after:
                what = f"{part.name} cannot repeat a length of stuffed bytes"
                self._report.error("bad-frame", (*path, part.name, "equals"), what, "stuff the whole frame")
            elif (
                part.derivation
                and part.scalar
                and (fault := beyond(part.derivation.added, source.name, part.scalar.bits))
            ):
                self._report.error("bad-frame", (*path, part.name, "equals"), *fault)

    def _check_length(self, frame: DelimitedFrame, path: Path) -> None:
        length = frame.part("length")
        if length is None or length.scalar is None or not length.counts:
            return
        if frame.payload.name not in length.counts:
            what = f"{length.name} does not count the payload"
            place, hint = (*path, length.name, "counts"), f"add {frame.payload.name}"
            needs = (place, (*path, frame.payload.name))
            self._report.error("bad-frame", place, what, hint, of_key=True, needs=needs)
            return
        self._check_scale(frame, length, path)
        if length.otherwise is not None:
            length = next((part for part in frame.parts if part.role == "length" and part.when), length)
        scalar = length.scalar or Scalar(bits=64, chunks=(), minimum=0, maximum=(1 << 64) - 1)
        longest = frame.length_bias + frame.payload.max_size
        if frame.stuffing and frame.checked_after:
            longest += frame.payload.max_size // len(frame.stuffing.after)
        longest = -(-longest // length.scale)
        if longest > scalar.maximum:
            what = f"{length.name} would be {longest} for the longest payload"
            most = f"{scalar.bits} bits hold {scalar.maximum}"
            hint = f"{most}; use a wider type or a shorter payload"
            self._report.error(
                "length-does-not-fit", (*path, length.name), what, hint, of_key=True, needs=(path,)
            )

    def _check_scale(self, frame: DelimitedFrame, length: Part, path: Path) -> None:
        """Check that the shortest frame has a length, and that no stuffed bytes are counted in steps."""
        if (shortest := frame.length_bias + frame.payload.min_size) < 0:
            what = f"{length.name} would be {shortest} for the shortest payload"
            hint = f"use a smaller offset, or payloads of at least {frame.payload.min_size - shortest} bytes"
            self._report.error(
                "length-does-not-fit", (*path, length.name, "offset"), what, hint, needs=(path,)
            )
        if length.scale > 1 and frame.checked_after:
            what = "stuffed bytes are not counted in steps"
            hint = "remove scale, or stuff the whole frame"
            self._report.error("bad-frame", (*path, length.name, "scale"), what, hint, needs=(path,))

    # Header and end marked by a bit

    def _marked(self, spec: MarkedSpec) -> MarkedFrame | None:
        path: Path = ("frame", "marked")
        address, message = (
            Chunk(first, last + 1 - first) for first, last in (spec.header.address, spec.header.message)
        )
        if not self._check_header(spec, path):
            return None
        if spec.end > message.mask:
            what = f"end {spec.end} does not fit the message bits"
            self._report.error("value-does-not-fit", (*path, "end"), what, f"use 0..{message.mask}")
        if spec.payload[1] > MAX_PAYLOAD:
            what = f"a payload of {spec.payload[1]} bytes is too long"
            self._report.error("bad-frame", (*path, "payload"), what, f"use at most {MAX_PAYLOAD}")
        frame = self._file.frame
        return MarkedFrame(
            marker=spec.marker, address_name="address", address_bits=address, id_name="type", id_bits=message,
            end_id=spec.end, payload_max=spec.payload[1], checksum=self._marked_checksum(spec, path),
            doc=frame.doc, section=frame.section,
        )  # fmt: skip

    def _marked_checksum(self, spec: MarkedSpec, path: Path) -> Checksum | None:
        if spec.checksum is None:
            return None
        place = (*path, "checksum")
        if spec.checksum.told != "checksum":
            if spec.checksum.role:
                what = f"the checksum has role: {spec.checksum.role}"
                self._report.error("bad-frame", (*place, "role"), what, "use role: checksum")
            else:
                what, hint = "the checksum has no algorithm", "add algorithm: crc-16/modbus"
                self._report.error("bad-frame", place, what, hint, of_key=True, absent=True)
            return None
        self._parts.reject(
            spec.checksum,
            ("value", "text", "counts", "size", "trim", "words", "rejected", "every", "otherwise", "as"),
            "checksum",
            place,
        )
        checksum = self._parts.checksum(spec.checksum, ("payload",), place)
        for index, name in enumerate(spec.checksum.over or ()):
            if name.startswith(ATTRIBUTE):
                what = f"{name} is not covered in a marked frame"
                self._parts.fault("not-applicable", (*place, "over", index), what, "remove it")
        if checksum and any(chunk.mask & spec.marker for chunk in checksum.chunks):
            what = f"a byte of the checksum can have the marker bit {spec.marker:#04x}"
            self._parts.fault("marker-in-payload", place, what, "divide it with sent: [0..6, 7..13]")
        return checksum

    def _check_header(self, spec: MarkedSpec, path: Path) -> bool:
        masks = [
            (1 << last + 1) - (1 << first)
            for first, last in (spec.header.address, spec.header.message)
            if last < 8
        ]
        fields = [spec.marker, *masks]
        if (
            spec.marker.bit_count() != 1
            or len(fields) < 3
            or sum(fields) != fields[0] | fields[1] | fields[2]
        ):
            what = "marker, address and message do not share one byte"
            self._parts.fault(
                "bad-frame", path, what, "use one bit for marker, and each of the eight bits at most once"
            )
            return False
        return True

    # Packets

    def _packet(self, specs: Mapping[str, PartSpec]) -> PacketFrame | None:
        path: Path = ("frame", "packet")
        if not self._parts.roles_fit(specs, ("message", "payload"), path) or not self._packet_roles_fit(
            specs, path
        ):
            return None
        places = {spec.told: (spec, (*path, name)) for name, spec in specs.items()}
        id_spec, id_place = places["message"]
        self._parts.reject(
            id_spec, ("value", "text", "counts", "size", "algorithm", "over"), "message", id_place
        )
        if self._parts.integer(id_spec, id_place).size != 1:
            what = "the message id of a packet must be one byte"
            self._report.error("bad-packet", (*id_place, "type"), what, "use u8", needs=(id_place,))
        high = self._parts.payload_size(*places["payload"])[1]
        frame, id_name = self._file.frame, str(id_place[-1])
        if "checksum" not in places:
            # Only a check value adds words; without one a message may have any size.
            return PacketFrame(id_name, high, word_size=1, doc=frame.doc, section=frame.section)
        check, check_place = places["checksum"]
        checksum = self._packet_checksum(check, specs, check_place)
        if checksum is None:
            return None
        name = str(check_place[-1])
        return PacketFrame(
            id_name, high, name, checksum, check.words, check.rejected, frame.doc, frame.section
        )

    def _packet_roles_fit(self, specs: Mapping[str, PartSpec], path: Path) -> bool:
        checks = [name for name, spec in specs.items() if spec.told == "checksum"]
        for name in checks[1:]:
            what = f"{name} and {checks[0]} are both the check value"
            self._parts.fault("bad-packet", (*path, name), what, "a packet has one check value")
        wrong = [name for name, spec in specs.items() if spec.told not in _PACKET_ROLES]
        for name in wrong:
            what = f"a part with role {specs[name].told} is not allowed in a packet"
            self._parts.fault(
                "bad-packet", (*path, name), what, f"use {listed(_PACKET_ROLES)}, or a frame of parts"
            )
        return not wrong and len(checks) < 2

    def _packet_checksum(self, spec: PartSpec, specs: Mapping[str, PartSpec], place: Path) -> Checksum | None:
        self._parts.reject(
            spec,
            (
                "value",
                "text",
                "counts",
                "size",
                "trim",
                "sent",
                "only",
                "over",
                "init",
                "every",
                "otherwise",
                "as",
            ),
            "packet's checksum",
            place,
        )
        over = [name for name, part in specs.items() if part.told != "checksum"]
        checksum = self._parts.checksum(spec.model_copy(update={"over": over}), specs, place)
        if checksum is not None and not (
            isinstance(checksum.algorithm, catalogue.Sum) and not checksum.algorithm.carry
        ):
            what = f"the check value of a packet must be a sum, not {checksum.algorithm.name}"
            self._report.error("bad-packet", (*place, "algorithm"), what, "use sum16 or sum8")
            return None
        if checksum is not None and spec.rejected is not None and spec.rejected > checksum.algorithm.mask:
            what = f"{spec.rejected} does not fit {checksum.algorithm.width} bits"
            hint = f"use 0..{checksum.algorithm.mask}"
            self._report.error("value-does-not-fit", (*place, "rejected"), what, hint)
        return checksum
