"""Telegrams of meters, from the tests of libmbus."""

from __future__ import annotations

import pytest

from tests.library.protocols import described, peer

TELEGRAMS = {
    "Itron CYBLE": """
        68 56 56 68 08 01 72 23 15 01 09 77 04 14 07 25 00 00 00 0C 78 23 15 01 09 0D 7C 08 44 49 20 2E
        74 73 75 63 0A 35 35 37 36 37 30 41 4C 39 30 04 6D 1A 0E CD 13 02 7C 09 65 6D 69 74 20 2E 74 61
        62 D4 09 04 13 1F 00 00 00 04 93 7F 00 00 00 00 44 13 1F 00 00 00 0F 00 01 1F A9 16""",
    "Kamstrup Multical 601": """
        68 F7 F7 68 08 11 72 17 58 85 06 2D 2C 08 04 04 00 00 00 0C 78 17 58 85 06 04 06 E7 91 00 00 04
        14 2C DB 00 00 04 22 D9 03 00 00 04 59 B9 27 00 00 04 5D 08 12 00 00 04 61 B1 15 00 00 04 2D 5B
        01 00 00 14 2D C0 01 00 00 04 3B 1F 02 00 00 14 3B 74 02 00 00 84 10 06 00 00 00 00 84 20 06 00
        00 00 00 84 40 14 00 00 00 00 84 80 40 14 00 00 00 00 84 C0 40 06 00 00 00 00 04 6D 1A 2F 65 11
        44 06 51 82 00 00 44 14 B2 C3 00 00 54 2D 26 02 00 00 54 3B 03 04 00 00 C4 10 06 00 00 00 00 C4
        20 06 00 00 00 00 C4 40 14 00 00 00 00 C4 80 40 14 00 00 00 00 C4 C0 40 06 00 00 00 00 42 6C 5F
        1C 0F 00 00 00 00 E7 E4 00 00 63 66 00 00 00 00 00 00 00 00 00 00 00 00 00 00 5B C9 A5 02 34 53
        00 00 E0 B2 03 00 89 9C 68 00 00 00 00 00 01 00 01 07 07 09 01 03 00 00 00 00 00 98 16""",
    "fillers": """
        68 1F 1F 68 08 00 72 31 77 67 17 2D 2C 01 02 00 00 00 00 2F 2F 04 83 3B 88 13 00 00 2F 2F 2F 2F
        2F 2F 2F 00 16""",
    "GMC EMMOD 206": """
        68 91 91 68 08 03 72 78 56 34 12 A3 1D E6 02 02 00 00 00 82 40 FD 48 60 03 82 80 40 FD 48 BF 03
        82 C0 40 FD 48 20 04 82 40 FD 59 BD 03 82 80 40 FD 59 1F 04 82 C0 40 FD 59 7E 04 82 40 2B E0 00
        82 40 2B 36 FF 84 10 04 94 28 00 00 84 20 04 98 3A 00 00 84 50 04 BF 4E 00 00 84 60 04 A8 61 00
        00 84 90 40 04 8B 75 00 00 84 A0 40 04 B8 88 00 00 84 D0 40 04 2D 9D 00 00 84 E0 40 04 C8 AF 00
        00 82 41 2B E0 00 82 42 2B 00 00 82 43 2B 00 00 82 44 2B CA 00 42 16""",
    "Siemens WFH21": """
        68 5E 5E 68 08 05 72 91 64 00 08 65 32 99 06 DA 00 00 00 0C 13 00 00 00 00 0B 22 86 40 04 04 6D
        24 0A 61 1C 32 6C 00 00 0C 78 91 64 00 08 06 FD 0C 0A 00 01 00 FA 01 0D FD 0B 05 31 32 48 46 57
        01 FD 0E 00 4C 13 00 00 00 00 42 6C 5F 1C 0F 37 FD 17 00 00 00 00 00 00 00 00 02 7A 25 00 02 78
        25 00 82 16""",
}


@pytest.mark.parametrize("meter", TELEGRAMS)
def test_a_telegram_of_a_meter(meter: str) -> None:
    wire, mbus = bytes.fromhex(TELEGRAMS[meter]), described("mbus")
    record = mbus.record(wire, "response")
    read = peer("mbus").read(wire, "response")
    assert read is not None
    assert read["fields"]["records"] == record["fields"]["records"]
    assert mbus.encoded(record) == wire


def test_the_records_of_a_telegram() -> None:
    fields = described("mbus").record(bytes.fromhex(TELEGRAMS["Itron CYBLE"]), "response")["fields"]
    records = fields["records"]
    assert bytes.fromhex(records[1]["unit"])[::-1] == b"cust. ID"
    assert bytes.fromhex(records[1]["value"]["text"])[::-1] == b"09LA076755"
    assert f"{records[0]['value']:08x}" == "09011523"
    assert records[-1]["manufacturer"] == "00011f"
