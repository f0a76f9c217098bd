"""Construct structures: style of their source, and rejection of errors."""

from __future__ import annotations

import importlib
import subprocess
import sys
from typing import Any

import pytest
from construct import ConstructError, Enum, FlagsEnum
from hypothesis import given
from hypothesis import strategies as st

from qlinkgen.backends import construct
from qlinkgen.backends.base import Options
from qlinkgen.backends.construct import tree
from qlinkgen.model import checksum as catalogue
from tests.proof import cases

every_protocol = pytest.mark.parametrize("name", cases.PROTOCOLS)


def source(name: str, options: Options | None = None) -> str:
    outputs = construct.generate(cases.protocol(name), options or Options())
    return outputs[f"{construct.FOLDER}/{name}.py"]


@every_protocol
def test_source_is_valid_and_has_its_imports(name: str) -> None:
    text = source(name)
    compile(text, name, "exec")
    for line in text.splitlines():
        if line.startswith(("from ._fields import ", "from ._frames import ")) and "(" not in line:
            module, _, names = line.removeprefix("from .").partition(" import ")
            support = importlib.import_module(f"qlinkgen.backends.construct.{module}")
            assert all(hasattr(support, each) for each in names.split(", "))


@every_protocol
def test_source_is_laid_out_within_the_margin(name: str) -> None:
    lines = source(name).splitlines()
    assert [line for line in lines if len(line) > tree.WIDTH and "#" not in line] == []
    assert [line for line in lines if line != line.rstrip()] == []


def test_source_is_made_without_construct() -> None:
    program = (
        "import sys; from qlinkgen.schema import find, load; from qlinkgen.backends import construct;"
        "from qlinkgen.backends.base import Options;"
        "construct.generate(load(find('qlink')), Options());"
        "print('construct' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=cases.ROOT
    )
    assert done.stdout.strip() == "False"


def test_named_constants_and_tables_are_there() -> None:
    names = cases.reference("qlink").names
    assert names["MESSAGES"]["motion.request"] is names["MOTION_REQUEST"]
    assert isinstance(names["POSITION_TYPE"], Enum)
    assert names["POSITION_TYPE"].encmapping == {"none": 0, "jvl_mactalk": 1, "metronix": 2}
    assert isinstance(names["MOTOR_STATUS"], FlagsEnum)
    assert names["MOTOR_STATUS"].flags == {"running": 1, "position_valid": 2}


def test_a_message_named_like_an_enum_gives_way() -> None:
    names = cases.reference("trio").names
    assert names["KEYPAD_MODE"].encmapping == {"on_only": 0, "on_off": 127}
    assert names["KEYPAD_MODE_MESSAGE"].name == "keypad_mode"


def test_a_whole_frame_is_a_container() -> None:
    frame = cases.reference("qlink").names["REQUEST_FRAME"]
    wire = frame.build({"message": "write_read.request", "node": 1, "fields": {"outputs": 0xA5FFA5}})
    assert wire == bytes.fromhex("A5A5 07 83 01 A500 FF A500 CC3B")
    assert frame.parse(wire) == {"message": "write_read.request", "node": 1, "fields": {"outputs": 0xA5FFA5}}


def test_only_keeps_the_named_messages() -> None:
    text = source("qlink", Options(only=("motion", "read.request")))
    assert "MOTION_REQUEST = " in text
    assert "MOTION_RESPONSE = " in text
    assert "READ_REQUEST = " in text
    assert "READ_RESPONSE" not in text
    assert "WRITE_REQUEST" not in text


@pytest.mark.parametrize("algorithm", catalogue.catalogue(), ids=lambda each: each.name)
def test_crc_by_definition_gives_the_check_values(algorithm: catalogue.Algorithm) -> None:
    support = importlib.import_module("qlinkgen.backends.construct._frames")
    crc = support.CRC(
        algorithm.width, algorithm.poly, algorithm.init, algorithm.refin, algorithm.refout, algorithm.xorout
    )
    assert crc.compute(b"123456789") == algorithm.check


def build(fields: dict[str, Any], message: str = "node_setup.request", node: Any = 1) -> bytes:
    frame = cases.reference("qlink").names["REQUEST_FRAME"]
    return bytes(frame.build({"message": message, "node": node, "fields": fields}))


@pytest.mark.parametrize(
    "fields",
    [
        {"node_number": 0},
        {"node_number": 17},
        {"node_number": "1"},
        {"t1_delay": 25.6},
        {"t1_delay": -0.1},
        {"t1_delay": float("nan")},
        {"t1_delay": float("inf")},
        {"t1_delay": "x"},
        {"position_type": 256},
        {"unknown": 1},
    ],
)
def test_illegal_values_are_refused(fields: dict[str, Any]) -> None:
    with pytest.raises(ConstructError):
        build(fields)


def test_illegal_addresses_are_refused() -> None:
    with pytest.raises(ConstructError):
        build({}, node=17)
    with pytest.raises(ConstructError):
        build({}, message="node_reset.request", node=0)
    with pytest.raises(ConstructError):
        build({}, message="node_reset.response")


@given(data=st.binary(max_size=60), choice=st.sampled_from(cases.PROTOCOLS))
def test_any_bytes_are_a_frame_or_an_error(data: bytes, choice: str) -> None:
    live = cases.reference(choice)
    for direction, frame in live.frames.items():
        try:
            found = live.parse(direction, data, data[:1])
        except ConstructError:
            continue
        assert found["message"] in frame.by_name


@given(data=st.binary(max_size=40), choice=st.sampled_from(cases.PROTOCOLS))
def test_any_bytes_are_a_payload_or_an_error(data: bytes, choice: str) -> None:
    for message in cases.reference(choice).messages.values():
        try:
            fields = message.parse(data)
        except ConstructError:
            continue
        # Reserved and omitted parts are normalised, which does not change the meaning.
        assert message.parse(message.build(fields)) == fields
