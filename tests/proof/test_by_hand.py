"""Rules of the documents on stuffing and checksums."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import pytest

from tests.proof import cases
from tests.proof.conftest import EVERY, Make
from tests.proof.outputs import Refused


def rows(kind: str) -> list[tuple[str, Mapping[str, Any]]]:
    return [(name, row) for name in cases.SHIPPED for row in cases.by_hand(name).get(kind, ())]


@pytest.mark.parametrize(("name", "row"), rows("stuffing"))
def test_stuffing(name: str, row: Mapping[str, Any]) -> None:
    stuffing = next(iter(cases.reference(name).frames.values())).stuffing
    plain, wire = bytes.fromhex(row["plain"]), bytes.fromhex(row["wire"])
    assert stuffing.add(plain) == wire
    assert stuffing.remove(wire) == plain


@pytest.mark.parametrize(("name", "row"), rows("checksums"))
def test_checksum(name: str, row: Mapping[str, Any]) -> None:
    names = cases.reference(name).names
    plain, check = bytes.fromhex(row["plain"]), bytes.fromhex(row["check"])
    if "request" in row:
        message = next(iter(names["MESSAGES"]))
        request = bytes.fromhex(row["request"])
        assert (
            cases.reference(name).wrap(message.replace("request", "response"), plain, 0, request)
            == plain + check
        )
    else:
        [sender] = next(iter(cases.reference(name).frames.values())).checks
        # The check value covers runs of bytes; here they are one.
        assert sender._replace(over=["all"]).value({"all": plain}, b"") == check


@pytest.mark.parametrize("output", EVERY)
def test_stuffing_is_undone_for_every_short_string(output: str, make: Make) -> None:
    made = make("qlink", output)
    message = cases.protocol("qlink").by_name["loop_back.request"]
    strings = [bytes(s) for size in range(1, 7) for s in itertools.product([0xA5, 0x00, 0x01], repeat=size)]
    assert len(strings) == 1092
    for data in strings:
        fields = {"offset": 0xA5, "data": data}
        _, wire = made.encode(message, fields, 1, b"")
        # After the preamble 00 follows each A5; without these bytes the original remains.
        assert wire[2:].count(b"\xa5") == wire[2:].count(b"\xa5\x00")
        body = wire[2:].replace(b"\xa5\x00", b"\xa5")
        assert (len(body), body[4:-2]) == (body[0] + 1, data)
        assert made.decode(message, wire, b"").fields == fields


@pytest.mark.parametrize("output", EVERY)
def test_document_example_of_stuffing_has_another_crc(output: str, make: Make) -> None:
    made = make("qlink", output)
    [example] = [row for row in cases.by_hand("qlink")["faults"] if row["kind"] == "crc"]
    with pytest.raises(Refused, match="crc"):
        made.decode(cases.protocol("qlink").by_name[example["message"]], bytes.fromhex(example["wire"]), b"")
