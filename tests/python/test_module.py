"""The generated text itself: the same on every run, light to import. Type checkers read it in `test_bus`."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from qlinkgen.backends.base import OWN, Options
from qlinkgen.backends.python import generate, load
from qlinkgen.codecs import mc1231a, qlink
from qlinkgen.schema import loads
from tests.python.protocols import EVERY, defaults, module, protocol, text_of

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the package of every protocol."""
    folder = tmp_path_factory.mktemp("generated")
    outputs: dict[str, str] = {}
    for name in EVERY:
        outputs.update(generate(protocol(name), Options(package=OWN)))
    for path, text in outputs.items():
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, "utf-8")
    return folder / "python"


def run(*command: str, cwd: Path) -> str:
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    return done.stdout


def test_the_text_does_not_depend_on_the_hash_seed() -> None:
    code = (
        "from tests.python.protocols import *; from qlinkgen.backends.python import generate;"
        "from qlinkgen.backends.base import Options; import hashlib;"
        "texts = [t for n in EVERY for t in generate(protocol(n), Options()).values()];"
        "print(hashlib.sha256(''.join(texts).encode()).hexdigest())"
    )
    seen = set()
    for seed in ("0", "1", "4711"):
        environment = {**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": str(ROOT)}
        command = [sys.executable, "-c", code]
        seen.add(subprocess.run(command, env=environment, cwd=ROOT, capture_output=True, check=True).stdout)
    assert len(seen) == 1


def test_a_module_needs_nothing_but_cheap_parts_of_the_standard_library(written: Path) -> None:
    for name in ("qlink", "mc1231a"):
        code = f"old = set(sys.modules); import wire.{name}; print(*set(sys.modules) - old)"
        loaded = set(
            run(
                sys.executable, "-S", "-E", "-c", f"import sys; sys.path.insert(0, '.'); {code}", cwd=written
            ).split()
        )
        own = {each for each in loaded if each.startswith("wire")}
        assert loaded - own <= {"__future__", "struct", "_struct", "binascii", "_operator"}


def test_lines_are_not_too_long_and_nothing_trails(written: Path) -> None:
    for name in EVERY:
        for number, line in enumerate((written / f"wire/{name}.py").read_text("utf-8").splitlines(), 1):
            assert line == line.rstrip(), f"{name}:{number}"
            assert len(line) <= 140, f"{name}:{number}: {line}"


def test_docstrings_have_the_facts_of_the_schema() -> None:
    text = qlink.NodeSetupRequest.__doc__ or ""
    assert "section 7.1" in text
    assert "0.0..25.5 s" in text
    assert "UNCONFIRMED" in (mc1231a.SetRatioRequest.__doc__ or "")
    assert "UNCONFIRMED" in (mc1231a.SetPosRequest.__doc__ or "")


def test_the_transaction_table_matches_the_schema() -> None:
    for command in protocol("qlink").commands:
        row = qlink.COMMANDS[command.name]
        assert (row.name, row.id, row.addressing) == (command.name, command.id, command.addressing)
        assert command.request.name == row.request.NAME
        assert (row.response is None) == (command.response is None)
        assert row.response_byte_times == command.response_within.byte_times
        assert row.response_seconds == pytest.approx(float(command.response_within.seconds))
        assert (row.repeat_safe, row.repeat_counter) == (command.repeat.safe, command.repeat.counter)
        assert row.echoes == command.repeated(command.response)
        assert (row.in_flight, row.section, row.confirmed) == (
            command.in_flight,
            command.section,
            command.confirmed,
        )
    assert mc1231a.COMMANDS["set_vel"].attributes["double_buffered"] is True


@pytest.mark.parametrize("name", EVERY)
def test_the_bus_matches_the_schema(name: str) -> None:
    bus, line = module(name).BUS, protocol(name).bus
    assert (bus.kind, bus.broadcast, bus.baud, bus.bits_per_byte) == (
        line.kind,
        line.broadcast,
        line.baud,
        line.bits_per_byte,
    )
    assert (bus.first_node, bus.last_node) == (line.nodes or (None, None))
    assert repr(bus) == repr(eval(repr(bus), {"Bus": module(name).Bus}))


def test_only_keeps_the_selected_messages() -> None:
    small = load(protocol("qlink"), Options(only=("motion", "node_info.response")))
    assert set(small.MESSAGES) == {"motion.request", "motion.response", "node_info.response"}
    assert set(small.COMMANDS) == {"motion"}
    message = small.MotionRequest(node=1, segments=[1])
    assert small.decode_request(message.to_frame()) == message


def test_a_role_has_the_decoders_that_it_needs() -> None:
    master = load(protocol("qlink"), Options(role="master"))
    assert not hasattr(master, "decode_request")
    assert master.decode_response(master.MotionResponse(node=1).to_frame()) == master.MotionResponse(node=1)
    assert master.StreamDecoder().feed(master.MotionResponse(node=1).to_frame()) == [
        master.MotionResponse(node=1)
    ]


# Frames that do not occur in schema files

CHECK = (
    "    check: {role: checksum, type: u8, algorithm: crc-8/smbus, over: [length, kind, station, payload]}"
)
VARIANTS = {
    "trailing constant": ("    check: {", "    end: {role: constant, value: 0x16}\n    check: {"),
    "constant at the end": ("payload]}\n\nbus", "payload]}\n    end: {role: constant, value: 0x16}\n\nbus"),
    "sum": ("algorithm: crc-8/smbus", "algorithm: sum8-inverted"),
    "stuffed frame": ("\n\nbus:", "\n  stuffing: {after: 0x7E, insert: 0x01, exempt: [start]}\n\nbus:"),
    "stuffed middle": (
        "\n\nbus:",
        "\n  stuffing: {after: 7E 01, insert: 0x02, exempt: [start, length, check]}\n\nbus:",
    ),
    "stuffed payload": ("\n\nbus:", "\n  stuffing: {after: 0x7E, insert: 0x01, checksum: after}\n\nbus:"),
    "no checksum": (CHECK + "\n", ""),
    "wide numbers": (
        "length: {role: length, type: u8",
        "length: {role: length, type: u16, byteorder: little",
    ),
    "no constant": ("    start: {role: constant, value: 0x7E}\n", ""),
    "unique": (
        "start: {role: constant, value: 0x7E}",
        "start: {role: constant, value: 7E 7E}",
        "\n\nbus:",
        "\n  stuffing: {after: 0x7E, insert: 0x01, exempt: [start]}\n\nbus:",
    ),
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_other_frames_work_too(variant: str) -> None:
    text = text_of("kitchen_sink")
    changes = VARIANTS[variant]
    for old, new in zip(changes[::2], changes[1::2], strict=True):
        assert old in text
        text = text.replace(old, new, 1)
    changed, faults = loads(text, "variant.yaml")
    assert changed is not None, faults
    codec = load(changed)
    special = [
        codec.CountedRequest(station=1, blob=b"~~~\x01~", words=[0x7E7E, 0x7E01], name="~~\x01"),
        codec.OpenEndResponse(station=1, note="~\x01~~"),
        codec.NamedRequest(station=1),
    ]
    noises = (b"",) if variant == "no checksum" else (b"", b"\x00", b"\x7e\x05", b"\x01\x02\x03")
    for direction, decode in (("request", codec.decode_request), ("response", codec.decode_response)):
        messages = [m for m in special if m.NAME.endswith(direction)]
        messages += [
            codec.MESSAGES[each.name](**defaults("kitchen_sink", each))
            for each in protocol("kitchen_sink").messages
            if each.direction == direction and "." in each.name
        ]
        wires = [message.to_frame() for message in messages]
        for message, wire in zip(messages, wires, strict=True):
            assert decode(wire) == message
            assert len(wire) <= message.MAX_WIRE_SIZE
            assert (
                type(message).from_bytes(message.to_bytes(), **{message.ADDRESS: message.station}) == message
            )
        for noise in noises:
            stream = noise + noise.join(wires)
            for step in (1, 7, len(stream)):
                decoder = codec.StreamDecoder(direction)
                found = [
                    e for at in range(0, len(stream), step) for e in decoder.feed(stream[at : at + step])
                ]
                found = [e for e in [*found, *decoder.finish()] if isinstance(e, codec.Message)]
                assert [m for m in found if m in messages] == messages, (variant, noise, step)
