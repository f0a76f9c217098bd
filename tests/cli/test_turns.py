"""Bytes of messages that only their turn in a dialogue tells, by the name of the message."""

from __future__ import annotations

import json
from typing import Any

import pytest

from tests.cli.conftest import Run


def test_explain_describes_them(qlinkgen: Run) -> None:
    done = qlinkgen("explain", "stm32", "--message", "read_memory.place", "08 00 01 00 09")
    assert done.code == 0, done.err
    assert "read_memory.place" in done.out
    assert "no errors" in done.out


@pytest.mark.parametrize(
    ("data", "rule"),
    [("08 00 01 00 0A", "check"), ("08 00 01", "read_memory.place"), ("08 00 01 00 09 79", "byte")],
)
def test_explain_names_what_is_wrong(qlinkgen: Run, data: str, rule: str) -> None:
    done = qlinkgen("explain", "stm32", "--message", "read_memory.place", data)
    assert done.code == 1
    assert rule in done.out
    assert "wrong:" in done.out


def test_decode_prints_them(qlinkgen: Run) -> None:
    done = qlinkgen("decode", "stm32", "--message", "get.known", "02 31 00 01")
    assert done.code == 0, done.err
    record: Any = json.loads(done.out)
    assert record == {"message": "get.known", "fields": {"version": 0x31, "codes": [0, 1]}, "offset": 0}
    wrong = qlinkgen("decode", "stm32", "--message", "get.known", "03 31 00 01")
    assert wrong.code == 1
    assert json.loads(wrong.out)["error"]["kind"] == "length"


def test_encode_makes_them(qlinkgen: Run) -> None:
    done = qlinkgen("encode", "stm32", "read_memory.amount", "count=256")
    assert done.out.strip() == "ff00"


def test_other_messages_need_no_name(qlinkgen: Run) -> None:
    done = qlinkgen("explain", "stm32", "--message", "get.request", "00 FF")
    assert done.code == 2
    assert "omit the option" in done.err
    chosen = qlinkgen("decode", "stm32", "--message", "get.request", "00 FF")
    assert json.loads(chosen.out)["message"] == "get.request"
