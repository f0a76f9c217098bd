"""`qlinkgen encode` and `decode`: scripts rely on their input and output."""

from __future__ import annotations

import itertools
import json
import re
import subprocess
from decimal import Decimal
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from qlinkgen.cli.codec import load_codec
from qlinkgen.cli.common import load_protocol
from qlinkgen.cli.streams import EitherWay, open_stream
from qlinkgen.model.checksum import find
from qlinkgen.schema import loads
from tests.cli.conftest import Run
from tests.cli.test_boundary import COMMAND, ENVIRONMENT

QLINK = load_codec(load_protocol("qlink"))

#: Frames that fit the request, the response, or both.
FRAMES = [
    "a5a504210315e8",
    "a5a50a2003010f006400c86bb6",
    "a5a50d20030000fffffffb000300f525",
    "a5a50d2001000000000000000300019c",
    "a5a5062003010081a6",
    "a5a5a50421",
]

#: Message, arguments, wire bytes; worked out by hand except for the check values.
GOLDEN = [
    ("qlink motor_position --node 3", "a5a504210315e8"),
    ("qlink motion --node 3 counter=1 outputs=0x0F segments=100,200", "a5a50a2003010f006400c86bb6"),
    ("qlink motion.request --node 3 counter=1 outputs=15 segments=[100,200]", "a5a50a2003010f006400c86bb6"),
    ("qlink motion.response --node 3 position=-5 motor_status=running|position_valid",
     "a5a50d20030000fffffffb000300f525"),
    ("qlink node_sync counter=9", "a5a505050009"),
    ("qlink node_setup --node 0 node_number=4 t1_delay=0.3 position_type=metronix", "a5a508010004030a02"),
    ('qlink motion.response --node 3 motor_status=["running","position_valid"]',
     "a5a50d2003000000000000000300"),
    ("qlink motion --node 3 counter=0b101", "a5a50620030500"),
    ("qlink write --node 1 offset=0 data=0xA5a5", "a5a507820100a500a500"),
    ("qlink write --node 1 offset=0 data=A5a5", "a5a507820100a500a500"),
    ("trio keypad_mode --address 2 mode=on_off", "947f90"),
    ("trio keypad_mode --node 2 mode=0x7f", "947f90"),
    ("trio character_transfer --address 15 characters=AZ", "f9415af8"),
    ("mc1231a set_pos value=1234567", "100012d687"),
    ("mc1231a set_vel value=2.75", "110002c000"),
    ("mc1231a get_pos.response --request 4a value=1234567", "0012d687d6e3"),
    ("mc1231a get_pos.response value=1234567", "0012d687d6e3"),
    ("mc1231a set_pos.response --request 10fffffff1", "0000"),
]  # fmt: skip


@pytest.mark.parametrize(("command", "wire"), GOLDEN)
def test_encode(qlinkgen: Run, command: str, wire: str) -> None:
    result = qlinkgen("encode", *command.split())
    assert result.code == 0, result.err
    assert result.out.startswith(wire)
    assert result.out == result.out.lower()
    assert len(result.lines) == 1


def decoded(qlinkgen: Run, *arguments: str | Path, stdin: bytes = b"", code: int = 0) -> list[dict[str, Any]]:
    result = qlinkgen("decode", *arguments, stdin=stdin)
    assert result.code == code, result.out + result.err
    return [json.loads(line, parse_float=Decimal) for line in result.lines]


def encoded(qlinkgen: Run, command: str) -> str:
    return qlinkgen("encode", *command.split()).out.strip()


def test_decode_inverts_encode(qlinkgen: Run) -> None:
    wire = encoded(qlinkgen, "qlink node_setup --node 0 node_number=4 t1_delay=0.3 position_type=metronix")
    fields = {
        "node_number": 4,
        "t1_delay": Decimal("0.3"),
        "t2_delay": Decimal("1.0"),
        "position_type": "metronix",
    }
    assert decoded(qlinkgen, "qlink", wire) == [
        {"message": "node_setup.request", "node": 0, "fields": fields, "offset": 0}
    ]


def test_json_in_and_out(qlinkgen: Run) -> None:
    fields = '{"counter": 255, "inputs": 165, "position": -1, "motor_status": ["running"], "fifo_space": 3}'
    wire = qlinkgen(
        "encode", "qlink", "motion.response", "--node", "16", "--json", fields, "fifo_space=4"
    ).out.strip()
    (found,) = decoded(qlinkgen, "qlink", "--direction", "response", wire)
    assert found == {
        "message": "motion.response",
        "node": 16,
        "fields": {"counter": 255, "inputs": 165, "position": -1, "motor_status": 1, "fifo_space": 4},
        "offset": 0,
    }


def test_unnamed_enum_numbers_are_kept(qlinkgen: Run) -> None:
    wire = encoded(qlinkgen, "qlink node_setup --node 1 position_type=77")
    assert decoded(qlinkgen, "qlink", wire)[0]["fields"]["position_type"] == 77


@pytest.mark.parametrize(
    "value",
    [
        "-2147483648",
        "2147483647.99999999976716935634613037109375",
        "-0.25",
        "0.00000000023283064365386962890625",
    ],
)
def test_every_digit_survives(qlinkgen: Run, value: str) -> None:
    for arguments in ((f"value={value}",), ("--json", f'{{"value": {value}}}')):
        wire = qlinkgen(
            "encode", "trio", "direct_variable_transfer", "--address", "1", *arguments
        ).out.strip()
        out = qlinkgen("decode", "trio", wire).out
        assert f'"value": {value}' in out


def test_noise_between_frames_is_fine(qlinkgen: Run) -> None:
    frame = encoded(qlinkgen, "qlink motor_position --node 3")
    found = decoded(qlinkgen, "qlink", "00ff" + frame + "a500" + frame + "1234")
    assert [each["message"] for each in found] == ["motor_position.request"] * 2


def test_directions_of_delimited_frames(qlinkgen: Run) -> None:
    """write_read has the same size both ways; a direct answer is taken for one."""
    request = encoded(qlinkgen, "qlink write_read --node 3")
    response = encoded(qlinkgen, "qlink write_read.response --node 3")
    other = encoded(qlinkgen, "qlink write_read --node 4")
    assert request == response
    names = [each["message"] for each in decoded(qlinkgen, "qlink", request + request + request)]
    assert names == ["write_read.request", "write_read.response", "write_read.request"]
    names = [each["message"] for each in decoded(qlinkgen, "qlink", request + other + response)]
    assert names == ["write_read.request"] * 3
    answer = encoded(qlinkgen, "qlink motion.response --node 3")
    (found,) = decoded(qlinkgen, "qlink", answer)
    assert found["message"] == "motion.response"
    (found,) = decoded(qlinkgen, "qlink", "--direction", "request", answer, code=1)
    assert found["error"]["kind"] == "length"


def test_bad_frames(qlinkgen: Run) -> None:
    good = encoded(qlinkgen, "qlink motor_position --node 3")
    bad = good[:-1] + ("0" if good[-1] != "0" else "1")
    found = decoded(qlinkgen, "qlink", "00" + bad + good + "a5a50421", code=1)
    assert [each.get("message") or each["error"]["kind"] for each in found] == [
        "crc",
        "motor_position.request",
        "truncated",
    ]
    assert found[0]["error"]["offset"] == 1
    assert found[0]["error"]["raw"] == bad
    assert set(found[0]["error"]) == {"kind", "offset", "raw", "message"}
    assert found[2]["error"]["offset"] == 15


@pytest.mark.parametrize("wire", ["", "00", "a5"])
def test_no_frame_at_all(qlinkgen: Run, wire: str) -> None:
    result = qlinkgen("decode", "qlink", "-", stdin=wire.encode())
    assert result.code == 1
    assert "no frame" in result.err or "no input" in result.err


def test_standard_input(qlinkgen: Run) -> None:
    frame = encoded(qlinkgen, "qlink motor_position --node 3")
    spaced = bytes.fromhex(frame).hex(" ").upper().replace(" ", "\n", 3).encode()
    for arguments, stdin in (
        ((), spaced),
        (("-",), spaced),
        (("--raw",), bytes.fromhex(frame)),
        (("-", "--raw"), bytes.fromhex(frame)),
    ):
        (found,) = decoded(qlinkgen, "qlink", *arguments, stdin=stdin)
        assert found["node"] == 3
    assert qlinkgen("decode", "qlink", "-", stdin=b"a5a").code == 2
    assert qlinkgen("decode", "qlink", "--raw", "a5").code == 2


def test_output_comes_frame_by_frame(qlinkgen: Run) -> None:
    """Piping a live line into decode prints each frame as soon as it is complete."""
    frame = encoded(qlinkgen, "trio keypad_mode --address 2")
    with subprocess.Popen([*COMMAND, "decode", "trio", "-"], env=ENVIRONMENT, stdin=-1, stdout=-1) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        for half in (frame[:3], frame[3:]):
            process.stdin.write(half.encode())
            process.stdin.flush()
        assert b'"keypad_mode"' in process.stdout.readline()
        process.stdin.close()
        assert process.wait(10) == 0


def test_comments_and_wrong_characters(qlinkgen: Run) -> None:
    text = b"# motor 3\na5a504210315e8 # zz\n0xa5 0xa5 0421\n0315e8\n"
    assert len(decoded(qlinkgen, "qlink", "-", stdin=text)) == 2
    result = qlinkgen("decode", "qlink", "-", stdin=text + b"a5 g5\n" + text)
    assert result.code == 0
    assert len(result.lines) == 4
    assert "standard input, line 5: 'g5' is not hex text; the rest of the line is passed over" in result.err
    assert qlinkgen("decode", "qlink", "--strict", "-", stdin=text + b"a5 g5\n").code == 1
    assert len(decoded(qlinkgen, "qlink", "0xa5a504", "0x210315e8")) == 1
    assert "(character 8)" in qlinkgen("decode", "qlink", "0xa5", "a5g").err


def test_encode_takes_what_decode_prints(qlinkgen: Run, thermo: Path) -> None:
    for protocol, command in (
        ("qlink", "motion --node 3 counter=1 segments=1,2"),
        ("trio", "direct_variable_transfer --address 2 number=7 value=-0.25"),
        (str(thermo), "set_target --node 3 target=21.5"),
    ):
        wire = encoded(qlinkgen, f"{protocol} {command}")
        line = qlinkgen("decode", protocol, wire).out
        assert qlinkgen("encode", protocol, "--json", line).out.strip() == wire
        assert qlinkgen("encode", protocol, command.split()[0], "--json", line).out.strip() == wire
        other = qlinkgen("encode", protocol, "--node", "5", "--json", line).out.strip()
        assert other == encoded(qlinkgen, protocol + " " + re.sub(r"--\w+ \d", "--node 5", command))


CORRUPTIONS = st.lists(st.tuples(st.integers(0, 5), st.integers(0, 40), st.integers(0, 255)), max_size=25)


@settings(max_examples=30, deadline=None)
@given(corruptions=CORRUPTIONS, sizes=st.lists(st.integers(1, 60), min_size=1, max_size=9))
def test_both_directions_whatever_is_fed_at_once(
    corruptions: list[tuple[int, int, int]], sizes: list[int]
) -> None:
    """Decoding both directions in chunks gives the same events as byte by byte."""
    protocol = load_protocol("qlink")
    codec = QLINK
    data = b""
    for which, at, value in corruptions:
        frame = bytearray(bytes.fromhex(FRAMES[which]))
        if at < len(frame):
            frame[at] = value
        data += bytes(frame)
    whole, bytewise, cut = (
        open_stream(protocol, codec, None),
        EitherWay(codec),
        open_stream(protocol, codec, None),
    )
    expected = [str(event) for byte in data for event in bytewise.feed(bytes((byte,)))]
    expected += map(str, bytewise.finish())
    assert [str(event) for event in (*whole.feed(data), *whole.finish())] == expected
    found: list[str] = []
    position = 0
    for size in itertools.cycle(sizes):
        if position >= len(data):
            break
        found += map(str, cut.feed(data[position : position + size]))
        position += size
    assert [*found, *map(str, cut.finish())] == expected


def test_marked_frames(qlinkgen: Run) -> None:
    found = decoded(qlinkgen, "trio", "947f90" + "8a", code=1)
    assert found[0] == {"message": "keypad_mode", "address": 2, "fields": {"mode": "on_off"}, "offset": 0}
    assert found[1]["error"]["kind"] == "truncated"
    assert qlinkgen("decode", "trio", "--direction", "request", "947f90").code == 2


def test_a_conversation_of_packets(qlinkgen: Run) -> None:
    wire = "02" + "0003" + "0005" + "10ffff8000" + "4a" + "0012d687d6e3" + "4a" + "4a"
    found = decoded(qlinkgen, "mc1231a", wire)
    names = ["set_2.request", "set_2.response", "set_pos.request", "get_pos.request", "get_pos.response"]
    assert [each["message"] for each in found] == [*names, "get_pos.request", "get_pos.request"]
    assert [each["offset"] for each in found] == [0, 1, 5, 10, 11, 17, 18]
    assert found[4]["fields"] == {"value": 1234567}
    assert "node" not in found[0]


def test_requests_out_of_range_in_a_conversation(qlinkgen: Run) -> None:
    found = decoded(qlinkgen, "mc1231a", "11fedcba98b985")
    assert [each["message"] for each in found] == ["set_vel.request", "set_vel.response"]
    for answer, said in (("800e", "set_pos.response"), ("0000", "illegal"), ("0003", "crc")):
        found = decoded(qlinkgen, "mc1231a", "107fffffff" + answer + "4a", code=1)
        kinds = [each.get("message") or each["error"]["kind"] for each in found]
        assert kinds == ["range", said, "get_pos.request"]


def test_one_side_of_packets(qlinkgen: Run) -> None:
    found = decoded(qlinkgen, "mc1231a", "--direction", "request", "02100000000a4a")
    assert [each["message"] for each in found] == ["set_2.request", "set_pos.request", "get_pos.request"]
    for arguments in (("--request", "4a"), ("--direction", "response", "--request", "4a")):
        (answer,) = decoded(qlinkgen, "mc1231a", *arguments, "0012d687d6e3")
        assert answer == {"message": "get_pos.response", "fields": {"value": 1234567}, "offset": 0}
    kinds = [
        each["error"]["kind"]
        for each in decoded(
            qlinkgen, "mc1231a", "--request", "4a", "0012d6870000" + "0012d687d6e4" + "00", code=1
        )
    ]
    assert kinds == ["illegal", "crc", "truncated"]
    assert "--request" in qlinkgen("decode", "mc1231a", "--direction", "response", "00").err


def test_a_refused_command_in_a_conversation(qlinkgen: Run) -> None:
    found = decoded(qlinkgen, "mc1231a", "4a" + "ffffffff0000" + "02", code=1)
    assert [each.get("message") or each["error"]["kind"] for each in found] == [
        "get_pos.request",
        "illegal",
        "set_2.request",
    ]


def test_an_own_schema(qlinkgen: Run, thermo: Path) -> None:
    wire = qlinkgen("encode", thermo, "set_target", "--node", "3", "target=21.5", "mode=cool").out.strip()
    assert wire == "7e81" + "0303" + "10" + "02" + "6608" + "86"
    answer = qlinkgen(
        "encode", thermo, "get_log.response", "--node", "3", "samples=-1,2", "heating=true", "level=5"
    )
    assert answer.out.strip() == "7e81" + "0306" + "11" + "02" + "ffff0200" + "51" + "6d"
    assert "get_log.response is unconfirmed" in answer.err
    found = decoded(qlinkgen, thermo, "99" + wire + answer.out.strip())
    assert found[0] == {
        "message": "set_target.request",
        "unit": 3,
        "fields": {"mode": "cool", "target": Decimal("21.5")},
        "offset": 1,
    }
    assert found[1]["fields"] == {"samples": [-1, 2], "heating": True, "level": 5}


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("qlink moton --node 1", "did you mean motion"),
        ("qlink motion", "needs an address; add --node N with N in 1..16"),
        ("qlink motion --node x", "not a whole number"),
        ("qlink motion --node 17", "1..16"),
        ("qlink motion --node 1 countr=1", "did you mean counter?"),
        ("qlink motion --node 1 counter", "is not FIELD=VALUE"),
        ("qlink motion --node 1 counter=256", "0..255"),
        ("qlink motion --node 1 counter=a", "'a' is not a whole number"),
        ("qlink motion --node 1 segments=1,2,3,4,5,6,7,8,9,10,11,12,13", "12"),
        ("qlink node_setup --node 1 t1_delay=25.6", "25.5"),
        ("qlink node_setup --node 1 t1_delay=nan", "nan"),
        (
            "qlink node_setup --node 1 position_type=nothing",
            "one of none, jvl_mactalk, metronix, or a number",
        ),
        ("qlink write --node 1 offset=0 data=a", "pairs of hex digits"),
        ("qlink motion --node 1 counter=1_0", "'1_0' is not a whole number"),
        ("qlink motion --node 1 counter=\u0663", "is not a whole number"),
        (f"qlink motion --node 1 counter={'9' * 5000}", "is not a whole number"),
        (f"qlink motion --node 1 segments=0x{'f' * 5000}", "is not a whole number"),
        (f"qlink motion --node {'1' * 5000}", "not a whole number"),
        (f"qlink node_setup --node 1 t1_delay={'9' * 5000}", "25.5"),
        ("qlink motion --node 1 counter=0o7", "is not a whole number"),
        ("qlink motion --node 1 counter=1 counter=2", "given twice"),
        ("qlink motion --node 1 --address 1", "given twice"),
        ("qlink motion --node 0", "motion cannot be broadcast; --node 1..16"),
        ("qlink node_sync --node 3", "node_sync can only be broadcast; omit --node"),
        ("qlink motion --node 1 segments=1,,2", "empty item"),
        ("qlink motion --node 1 segments=1,65536", "segments[1]: 65536 is out of range 0..65535"),
        ("qlink motion --node 1 segments=1,2,3,4,5,6,7,8,9,10,11,12,13", "13 items; at most 12"),
        ("qlink motor_request --node 1", "motor_data has no default; add motor_data=VALUE"),
        ("trio character_transfer --address 1", "characters has no default; add characters=VALUE"),
        ("qlink", "Missing argument 'MESSAGE'"),
        ('qlink motion --node 1 --json {"counter":-1.5}', "counter: -1.5 is not"),
        ('qlink motion --node 1 --json {"counter":null}', "counter: null is not"),
        ('qlink motion --node 1 --json {"counter":true}', "counter: true is not"),
        (
            'qlink node_info --node 1 --json {"message":"motion.request","fields":{}}',
            "--json: the object is a motion.request, not a node_info.request",
        ),
        ("qlink motion --node 1 --set crc=bogus", "--set crc=bogus: unknown checksum algorithm"),
        ("qlink motion --node 1 --set crc=crc-32/iso-hdlc", "--set crc=crc-32/iso-hdlc: "),
        ("qlink motion --node 1 --json [1]", "not a JSON object; write for example"),
        ("qlink motion --node 1 --json {", "invalid JSON at character"),
        ('qlink motion --node 1 --json {"counter":1,"counter":2}', "duplicate key"),
        ('qlink motion --node 1 --json {"counter":NaN}', "NaN is not a finite number"),
        ('qlink motion --node 1 --json {"counter":1.5}', "not a whole number"),
        ('qlink motion --node 1 --json {"counter":null}', "not a whole number"),
        ("mc1231a set_pos --node 1", "has no address"),
        ("mc1231a set_pos.response", "pass --request HEX"),
        ("mc1231a get_pos.response --request 02", "not the request of get_pos.response"),
        ("mc1231a get_pos.response --request ff", "--request ff"),
        ("qlink motion --node 1 --request 00", "omit --request"),
        ("trio character_transfer --address 1 characters=\u00e4", "characters"),
    ],
)
def test_wrong_values(qlinkgen: Run, command: str, said: str) -> None:
    result = qlinkgen("encode", *command.split())
    assert result.code == 2
    assert said in result.err
    assert result.out == ""


def test_fields_that_the_codec_fills(qlinkgen: Run, thermo: Path) -> None:
    result = qlinkgen("encode", thermo, "get_log.response", "--node", "1", "count=2")
    assert result.code == 2
    assert "'count' is filled in by the encoder" in result.err


def test_another_crc_of_a_frame_without_a_checksum(qlinkgen: Run, tmp_path: Path, thermo: Path) -> None:
    text = thermo.read_text()
    schema = tmp_path / "unchecked.yaml"
    schema.write_text(re.sub(r"^ *sum: .*\n", "", text, flags=re.MULTILINE))
    for arguments in (
        ("encode", schema, "get_log", "--node", "1"),
        ("generate", schema, "-o", tmp_path / "o"),
    ):
        result = qlinkgen(*arguments, "--set", "crc=bogus")
        assert (result.code, (tmp_path / "o").exists()) == (2, False)
        assert "--set crc=bogus: the frame of thermo has no checksum" in result.err


@pytest.mark.parametrize("protocol", ["qlink", "trio", "mc1231a"])
def test_another_crc(qlinkgen: Run, protocol: str) -> None:
    result = qlinkgen("encode", "qlink", "motor_position", "--node", "3", "--set", "crc=crc-ccitt")
    assert "several algorithms have this name; write one of crc-16/ibm-3740, crc-16/kermit, " in result.err
    result = qlinkgen("encode", "qlink", "motor_position", "--node", "3", "--set", "crc=crc-16/xmodem")
    assert "several algorithms" not in result.err
    assert result.out.startswith("a5a5042103")
    assert qlinkgen("decode", "qlink", result.out.strip()).code == 1
    assert qlinkgen("decode", "qlink", result.out.strip(), "--set", "crc=xmodem").code == 0
    assert qlinkgen("explain", "qlink", result.out.strip(), "--set", "crc=xmodem").code == 0


def test_another_coverage(qlinkgen: Run) -> None:
    """Section 6.2 of Q.link leaves the length out of the CRC."""
    over = ("--set", "crc_over=command,node,data")
    request = ("motor_position", "--node", "3")
    result = qlinkgen("encode", "qlink", *request, *over)
    covered = bytes.fromhex(result.out)[3:-2]
    assert covered == b"\x21\x03"
    assert int(result.out.strip()[-4:], 16) == find("crc-16/ibm-3740").compute(covered)
    for command in ("decode", "explain"):
        assert qlinkgen(command, "qlink", result.out.strip(), *over).code == 0
        assert qlinkgen(command, "qlink", result.out.strip()).code == 1
    both = qlinkgen("encode", "qlink", *request, *over, "--set", "crc=xmodem")
    assert int(both.out.strip()[-4:], 16) == find("crc-16/xmodem").compute(covered)
    refused = qlinkgen("simulate", "qlink", *over)
    assert refused.code == 2
    assert "--set crc_over=command,node,data: this uses the module of the package" in refused.err
    packet = qlinkgen("encode", "mc1231a", "update", "--set", "crc_over=command")
    assert packet.code == 2
    assert "the check value of a packet covers all of it; omit the option" in packet.err


@pytest.mark.slow
@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(data=st.binary(max_size=60), mixed=st.booleans())
@pytest.mark.parametrize("protocol", ["qlink", "trio", "mc1231a"])
def test_any_bytes_end_without_a_traceback(qlinkgen: Run, protocol: str, data: bytes, mixed: bool) -> None:
    """Random bytes, and ones that frames are made of, so that some of them come far."""
    if mixed:
        likely = bytes.fromhex("a5a50420210300034a10948a92")
        data = bytes(likely[byte % len(likely)] for byte in data)
    for command in ("decode", "explain"):
        result = qlinkgen(command, protocol, data.hex() or "00")
        assert result.code in (0, 1), result.err
        assert "a fault of qlinkgen" not in result.err
    for line in qlinkgen("decode", protocol, "-", "--raw", stdin=data).lines:
        assert set(json.loads(line)) <= {"message", "node", "address", "fields", "error", "offset"}


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(text=st.text(max_size=20))
def test_any_text_as_hex(qlinkgen: Run, text: str) -> None:
    result = qlinkgen("decode", "qlink", "--", text)
    assert result.code in (1, 2)
    assert "a fault of qlinkgen" not in result.err


def test_each_line_is_a_frame_where_only_a_silence_ends_one(qlinkgen: Run, tmp_path: Path) -> None:
    schema = tmp_path / "gauge.yaml"
    schema.write_text(
        """\
qlinkgen: 1
protocol: {name: gauge, revision: "1", source: Made up}
frame:
  parts:
    code: {role: message, type: u8}
    data: {role: payload, size: 0..8}
    sum: {type: u8, algorithm: sum8, over: [code, data]}
    gap: {role: idle, time: 3.5 bytes, alone: true}
bus: {kind: master_slave}
defaults: {repeat: safe}
commands: {read: {id: 1, request: {text: text}, response: {}}}
"""
    )
    lines = b"01 41 # one\n 42\n01 41 42 84\n\n0101\n01 41 42 84"
    found = decoded(qlinkgen, schema, "-", stdin=lines)
    kinds = [each["error"]["kind"] if "error" in each else each["message"] for each in found]
    assert kinds == ["crc", "length", "read.request", "read.response", "read.request"]
    assert len(decoded(qlinkgen, schema, "01 41", "42 84")) == 1
    assert "one frame on each line" in qlinkgen("decode", schema, "--raw", stdin=b"\1").err


H4 = """
qlinkgen: 1
protocol: {name: h4, revision: "1", source: Made up}
byteorder: little
frames:
  command:
    if: {direction: request}
    parts:
      kind: 01
      opcode: {role: message, type: u16}
      length: {type: u8, counts: data}
      data: {role: payload, size: 0..255}
  event:
    if: {direction: response}
    parts:
      kind: 04
      code: {role: message, type: u8}
      length: {type: u8, counts: data}
      data: {role: payload, size: 0..255}
bus: {kind: master_slave}
defaults: {addressing: none, repeat: safe, frame: command}
messages:
  complete: {frame: event, id: 14, direction: response, fields: {packets: u8, opcode: u16, rest: bytes}}
commands:
  reset: {id: 0x0C03, request: {}, response: complete}
"""


def test_a_request_at_the_end_of_an_answer_is_data() -> None:
    protocol, faults = loads(H4, "h4.yaml")
    assert protocol is not None, faults
    stream = open_stream(protocol, load_codec(protocol), None)
    events = [*stream.feed(bytes.fromhex("01 03 0C 00 04 0E 04 01 03 0C 00")), *stream.finish()]
    assert [getattr(event, "NAME", event) for event in events] == ["reset.request", "complete"]
