"""cbmc proves that each receiver is memory-safe on any stream, and each message on any bytes.

The proofs and invariants are in tests/c/proofs. A step of a receiver is proven with the payload size of its
schema. Streams from reset and messages are proven with payloads cut to a few bytes, so that their ends are
reached.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.c.conftest import SHIPPED, protocol_of
from tests.support.cbmc import (
    Verdict,
    prove,
    reach,
    shrunk,
    write_header,
    write_master_proof,
    write_message_proof,
    write_receiver_proof,
)
from tests.support.planted import Fault, one_more

pytestmark = pytest.mark.optional_tool("cbmc")

#: Payload size in a proof from reset: small enough that sixteen bytes fill the buffer of the receiver.
SMALL = {"qlink": 4, "trio": 12, "mc1231a": 4}
STREAM = 16
#: Loops of the header run once per byte of a frame, those of the check value once per bit of a byte.
UNWIND = STREAM + 2
SMALL_MESSAGE = 12


@pytest.fixture(scope="module")
def cbmc(optional_tool: Callable[..., str]) -> str:
    return optional_tool("cbmc", how=".ci/install-cbmc brings it where Debian has no package")


def holds(verdict: Verdict) -> None:
    assert len(verdict.properties) > 20
    assert not verdict.failed()


@pytest.mark.parametrize("name", SHIPPED)
def test_a_step_keeps_the_invariant(name: str, tmp_path: Path, cbmc: str) -> None:
    """From any state that satisfies the invariant: by induction it holds for streams of any length."""
    write_header(protocol_of(name), tmp_path)
    proof = write_receiver_proof(protocol_of(name), tmp_path)
    assert not prove(cbmc, proof, "start", UNWIND).failed()
    holds(prove(cbmc, proof, "step", UNWIND))


@pytest.mark.parametrize("name", SHIPPED)
def test_the_invariant_is_not_empty(name: str, tmp_path: Path, cbmc: str) -> None:
    """Every state, a full buffer and every event can be reached under it."""
    write_header(protocol_of(name), tmp_path)
    verdict = reach(cbmc, write_receiver_proof(protocol_of(name), tmp_path), "step", UNWIND)
    assert len(verdict.properties) > 5
    assert not verdict.failed()


@pytest.mark.parametrize("name", SHIPPED)
def test_bytes_from_reset(name: str, tmp_path: Path, cbmc: str) -> None:
    """Any sixteen bytes are memory-safe; they can contain the longest frame, or two frames."""
    protocol = shrunk(protocol_of(name), SMALL[name])
    write_header(protocol, tmp_path)
    proof = write_receiver_proof(protocol, tmp_path)
    holds(prove(cbmc, proof, "stream", UNWIND))
    assert not reach(cbmc, proof, "stream", UNWIND).failed()


#: A bound of each receiver, and the bound off by one.
FAULTS = {
    "qlink": Fault("qlink_receive", r"(> )(\d+)U", one_more),
    "trio": Fault("trio_receive", r"(count == )(\d+)U", one_more),
    "mc1231a": Fault("mc1231a_receive", "count < receiver->expected", "count <= receiver->expected"),
}


@pytest.mark.parametrize("name", SHIPPED)
def test_an_off_by_one_is_found(name: str, tmp_path: Path, cbmc: str) -> None:
    """From reset, as a byte beyond the buffer: the proof can fail."""
    protocol = shrunk(protocol_of(name), SMALL[name])
    file = write_header(protocol, tmp_path)
    file.write_text(FAULTS[name].planted(file.read_text("utf-8")), "utf-8")
    failed = prove(cbmc, write_receiver_proof(protocol, tmp_path), "stream", UNWIND).failed()
    beyond = rf"{name}_receive\.(array_bounds|pointer_dereference).* (upper bound|outside object bounds) in "
    assert [each for each in failed if re.match(beyond, each)], failed


@pytest.mark.parametrize("what", ["decoding", "encoding"])
@pytest.mark.parametrize("name", SHIPPED)
def test_messages(name: str, what: str, tmp_path: Path, cbmc: str) -> None:
    """Decoding any number of any bytes, encoding any values to a buffer of any size."""
    protocol = shrunk(protocol_of(name), SMALL_MESSAGE)
    write_header(protocol, tmp_path)
    holds(prove(cbmc, write_message_proof(protocol, tmp_path), what, SMALL_MESSAGE + 2))


#: Loops of the master run once per byte of the part of a request that was received.
MOST = 5
ECHO = ("matched_.0", "matched_.1", "matched_.2", "is_echo_.0")
UNWOUND = ("--unwindset", ",".join(f"qlink_bus_{each}:{MOST + 2}" for each in ECHO))


@pytest.mark.slow
@pytest.mark.parametrize("call", ["start", "receive", "match", "poll", "give_up", "ask"])
def test_a_call_keeps_the_invariant_of_the_master(call: str, tmp_path: Path, cbmc: str) -> None:
    """From any state and at any time: by induction it holds for any calls in any order."""
    proof = write_master_proof(shrunk(protocol_of("qlink"), SMALL["qlink"]), tmp_path, "read", MOST)
    holds(prove(cbmc, proof, call, UNWIND + 2, *UNWOUND))


#: The comparison with an echo runs past the request; the next request is written over an awaited echo.
MASTER_FAULTS = {
    "match": ("(matched == bus->size) || ", ""),
    "poll": ("if (bus->echoing) { /*", "if (false) { /*"),
}


@pytest.mark.slow
@pytest.mark.parametrize("call", MASTER_FAULTS)
def test_a_fault_of_the_master_is_found(call: str, tmp_path: Path, cbmc: str) -> None:
    proof = write_master_proof(shrunk(protocol_of("qlink"), SMALL["qlink"]), tmp_path, "read", MOST)
    file = tmp_path / "qlink_master.h"
    text = file.read_text("utf-8")
    assert text.count(MASTER_FAULTS[call][0]) == 1
    file.write_text(text.replace(*MASTER_FAULTS[call]), "utf-8")
    assert prove(cbmc, proof, call, UNWIND + 2, *UNWOUND).failed()
