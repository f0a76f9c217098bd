"""Answers of packets whose check value was not read: `decode` and `explain` say the same of them."""

from __future__ import annotations

import json
import random

import pytest

from qlinkgen.cli import describe
from qlinkgen.cli.conversations import are_requests
from qlinkgen.model.transaction import Command
from qlinkgen.schema import find, load
from qlinkgen_codecs import mc1231a
from tests.cli.conftest import Run

PROTOCOL = load(find("mc1231a"))
#: One command for each shape of an answer.
ANSWERED = list(
    {
        tuple(describe.type_text(field.type) for field in each.response.fields): each
        for each in PROTOCOL.commands
        if each.response and each.response.max_size
    }.values()
)
FINE = "every rule is kept"


def request_of(name: str) -> bytes:
    return bytes(mc1231a.COMMANDS[name].request().to_frame())


@pytest.mark.parametrize("command", ANSWERED, ids=lambda each: each.name)
def test_every_answer(qlinkgen: Run, command: Command) -> None:
    name = command.name
    request, chance = request_of(name), random.Random(name)
    size = PROTOCOL.message(f"{name}.response").max_size
    for payload in (bytes(size), chance.randbytes(size)):
        arguments = ("mc1231a", "--request", request.hex(), payload.hex())
        decoded = qlinkgen("decode", "--direction", "response", *arguments)
        explained = qlinkgen("explain", *arguments)
        if "illegal" in decoded.out or '"range"' in decoded.out:
            assert (decoded.code, explained.code) == (1, 1)
            continue
        assert (decoded.code, explained.code) == (0, 0), (decoded.out, explained.out)
        assert json.loads(decoded.out)["message"] == f"{name}.response"
        assert "the check value was not read; reading it is optional" in explained.out
        assert FINE in explained.out

        whole = ("mc1231a", request.hex() + payload.hex())
        messages = [json.loads(line).get("message") for line in qlinkgen("decode", *whole).lines]
        explained = qlinkgen("explain", *whole)
        assert explained.code == 0
        if are_requests(PROTOCOL, payload):
            assert f"{name}.response" not in messages
            assert "(next packet)" in explained.out
        else:
            assert messages == [f"{name}.request", f"{name}.response"]
            assert "(next packet)" not in explained.out


@pytest.mark.parametrize("command", ANSWERED[:3], ids=lambda each: each.name)
def test_every_cut(qlinkgen: Run, command: Command) -> None:
    """Any other size is wrong in both: an answer is whole with its check value, or without."""
    name = command.name
    request = request_of(name)
    response = mc1231a.COMMANDS[name].response
    assert response is not None
    answer = qlinkgen(
        "encode", "mc1231a", f"{name}.response", "--request", request.hex(), "--json", "{}"
    ).out.strip()
    if not answer:
        return  # a value has to be given
    for size in range(1, len(answer) // 2 + 1):
        arguments = ("mc1231a", "--request", request.hex(), answer[: 2 * size])
        fine = len(answer) // 2 - size in {0, 2}
        assert (qlinkgen("decode", "--direction", "response", *arguments).code == 0) is fine, size
        assert (qlinkgen("explain", *arguments).code == 0) is fine, size


def test_the_last_of_several_answers(qlinkgen: Run) -> None:
    result = qlinkgen("decode", "mc1231a", "4a" + "0012d687d6e3" + "4a" + "0012d687")
    names = [json.loads(line)["message"] for line in result.lines]
    assert (result.code, names) == (0, ["get_pos.request", "get_pos.response"] * 2)
    # Requests that nothing answers stay requests.
    result = qlinkgen("decode", "mc1231a", "4a" * 5)
    assert [json.loads(line)["message"] for line in result.lines] == ["get_pos.request"] * 5
