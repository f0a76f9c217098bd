"""Everything that a kit says, as strings and small integers for the templates."""

from __future__ import annotations

from typing import Any

from qlinkgen.backends.base import banner
from qlinkgen.backends.conformance import streams
from qlinkgen.backends.conformance.layout import numbers, wrapped
from qlinkgen.backends.conformance.messages import ERRORS, Entries
from qlinkgen.backends.conformance.rows import Right, kinds_in, most_values, rows_of
from qlinkgen.backends.conformance.sources import Sources
from qlinkgen.errors import GenerationError
from qlinkgen.model.checksum import Algorithm
from qlinkgen.model.naming import file_stem
from qlinkgen.plan import Plan
from qlinkgen.plan.framing import Rescan

#: Bits of a row's first byte that name kinds; the two above them say "by hand" and "refused".
_KINDS = 6


class Kit:
    """Lowers the vectors of a protocol to the tables of a C file."""

    def __init__(self, plan: Plan, sources: Sources) -> None:
        """``plan`` has what the header has."""
        self._plan = plan
        self._header = sources.header
        self._rows = rows_of(plan, sources)
        self._every = [row for each in self._rows.values() for row in each]
        self._entries = Entries(plan, sources.header, self._rows)

    def view(self) -> dict[str, Any]:
        """What the templates place."""
        header, entries = self._header, self._entries.views()
        check, kinds, noise = self._check(), self._kinds(), streams.noise(self._plan)
        tests = bool(check) + sum(entry[key] for entry in entries for key in _COUNTED)
        most_wire = max(len(row.wire) for row in self._every)
        return {
            "about": [piece for line in banner(self._plan.protocol) for piece in wrapped(line)],
            "p": header.prefix,
            "header": file_stem(header.prefix),
            "P": header.upper,
            **{name: getattr(header, name) for name in _HABITS},
            "address_type": f"uint{header.address_bits}_t",
            "address_bytes": header.address_bits // 8,
            "rescans": isinstance(self._plan.frame.receiver, Rescan),
            "packets": self._plan.frame.needs_request,
            "broadcast": header.address and self._plan.protocol.bus.broadcast is not None,
            "size_bytes": self._entries.size_bytes,
            **self._types(entries, most_wire, tests),
            "check": check,
            "kinds": [{"name": kind, "bit": f"0x{1 << bit:02X}"} for bit, kind in enumerate(kinds)],
            "kind_mask": f"0x{(1 << _KINDS) - 1:02X}",
            "kind_size": max(map(len, kinds)) + 1,
            "errors": ERRORS,
            "error_size": max(map(len, ERRORS)) + 1,
            "noise": [numbers((len(piece), *piece)) for piece in noise],
            "noise_size": max(map(len, noise)) + 1,
            "most_wire": most_wire,
            # An answer without a payload that nothing frames or checks.
            "empty_wires": not all(row.wire for row in self._every if isinstance(row, Right)),
            "most_request": max(len(row.request) for row in self._every),
            "most_values": max(1, *(most_values(header, each.message) for each in self._plan.messages)),
            "most_events": self._entries.most_events + 1,
            "entries": entries,
            "last": len(entries) - 1,
            "tests": tests,
            "has_requests": bool(header.sum_bits and any(row.request for row in self._every)),
            "refuses": any(entry["unsent_lines"] for entry in entries),
            "encodes": any(entry["encoded"] for entry in entries),
            "decodes": any(entry["decoded"] for entry in entries),
            "receives": any(entry["received"] for entry in entries),
            "asks": any(entry["slave_member"] for entry in entries),
            "tells": any(entry["told_member"] for entry in entries),
            "checks": sorted({entry["taken_as"] for entry in entries if entry["framed"]}),
        }

    def _types(self, entries: list[dict[str, Any]], most_wire: int, tests: int) -> dict[str, Any]:
        """Unsigned types that hold every number of the kit; 16 bits where they do, for small targets."""
        members = max(len(entry["members"]) for entry in entries)
        values = max(most_values(self._header, each.message) for each in self._plan.messages)
        printed = max(tests, most_wire, (1 << self._header.address_bits) - 1)
        return {
            # A number in a struct is followed by up to seven bytes of padding.
            "place_type": _unsigned(values + 8 * members),
            "id_type": _unsigned((1 << self._header.id_bits) - 1),
            "number_type": _unsigned(tests),
            "member_type": "uint8_t" if members <= 0xFF else "uint16_t",
            "printed_type": _unsigned(printed),
            "printed_digits": len(str(printed)) if printed > 0xFFFF else 5,
        }

    def _kinds(self) -> tuple[str, ...]:
        kinds = tuple(kinds_in(self._rows))
        if len(kinds) > _KINDS:
            raise GenerationError(
                f"{self._plan.protocol.name}: {len(kinds)} kinds of vectors; a kit holds {_KINDS}"
            )
        return kinds

    def _check(self) -> dict[str, Any] | None:
        """The check value of the nine characters 123456789, where it is a CRC."""
        check, bits = self._plan.frame.check, self._header.check_bits
        if check is None or not bits or not isinstance(check.algorithm, Algorithm):
            return None
        algorithm = check.algorithm
        suffix = {8: "u", 16: "u", 32: "ul", 64: "ull"}[bits]
        value = f"0x{algorithm.check:0{bits // 4}X}"
        return {"name": algorithm.name, "bits": bits, "value": value, "literal": value + suffix}


def _unsigned(most: int) -> str:
    return next(f"uint{bits}_t" for bits in (16, 32, 64) if most < 1 << bits)


#: What the templates ask of the header under its own name.
_HABITS = ("id", "address", "directed", "unpacks", "listener", "sum_bits")
#: Numbers of tests of a message.
_COUNTED = ("tests", "asked_tests", "told_tests")
