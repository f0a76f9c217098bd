"""Parts that only the frames of one direction have, in Python and on the command line."""

from __future__ import annotations

import json
from pathlib import Path
from types import ModuleType

import pytest

from qlinkgen.backends.python import load as load_module
from qlinkgen.backends.python.ways import definitions, differing, merged
from qlinkgen.cli.decode import message_record
from qlinkgen.errors import Refused
from qlinkgen.link import MasterEngine, Timing
from qlinkgen.schema import load
from tests.cli.conftest import Run
from tests.link.line import drive

FILE = Path(__file__).parents[1] / "schemas" / "axis.yaml"
REQUEST = "05 01 03 30 00 00 01 F4 A5 D3"
REFUSED = "02 05 02 01 FE 00 00 00 00 08"


@pytest.fixture(scope="module")
def axis() -> ModuleType:
    return load_module(load(FILE))


def test_each_direction_has_its_own_parts(axis: ModuleType) -> None:
    request = axis.RotateRequest(node=5, speed=500, kind=3)
    assert request.to_frame().hex(" ").upper() == REQUEST
    assert axis.decode_request(bytes.fromhex(REQUEST)) == request
    assert not hasattr(request, "status")
    answer = axis.decode_response(bytes.fromhex(REFUSED))
    assert (answer.node, answer.host, answer.status) == (5, 2, 2)
    assert not hasattr(answer, "kind")
    with pytest.raises(axis.DecodeError):
        axis.decode_request(bytes.fromhex(REFUSED))


def test_records_have_the_values_of_their_direction(axis: ModuleType, qlinkgen: Run) -> None:
    found = message_record(load(FILE), axis.decode_response(bytes.fromhex(REFUSED)))
    assert found["status"] == "wrong_command"
    assert found["refused"] is True
    told = qlinkgen("encode", FILE, "rotate", "speed=500", "kind=3", "--node", "5")
    assert bytes.fromhex(told.out) == bytes.fromhex(REQUEST)
    record = qlinkgen("decode", FILE, "--direction", "request", REQUEST)
    assert json.loads(record.out) == {
        "message": "rotate.request", "node": 5, "kind_": 3, "number": 0, "fields": {"speed": 500},
        "offset": 0,
    }  # fmt: skip


def test_a_value_of_an_answer_refuses(axis: ModuleType) -> None:
    master = MasterEngine(axis, Timing.of(axis, host_slack=0.002, attempts=1, baud=9600))
    outcome = drive(master, axis.RotateRequest(node=5, speed=0), ((0.012, bytes.fromhex(REFUSED)),))
    assert isinstance(outcome.error, Refused)
    assert outcome.error.reply == axis.decode_response(bytes.fromhex(REFUSED))
    assert outcome.error.reason == "wrong_command"


def test_what_both_directions_have_is_printed_once() -> None:
    request = definitions("_SIZE = 1\n_MORE = 2\n\n\ndef _get() -> int:\n    return _SIZE\n")
    response = definitions("_SIZE = 1\n_MORE = 3\n\n\ndef _get() -> int:\n    return _SIZE\n")
    texts = {"request": request, "response": response}
    ways = differing([request, response])
    assert ways.names == {"_MORE"}
    both = "_SIZE = 1 _MORE_REQUEST = 2 _MORE_RESPONSE = 3 def _get() -> int: return _SIZE"
    assert " ".join(merged(texts, ways).split()) == both
    response["_SIZE"] = "_SIZE = 4"
    assert differing([request, response]).names == {"_MORE", "_SIZE", "_get"}
