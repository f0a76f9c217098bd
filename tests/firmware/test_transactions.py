"""Thousands of mixed transactions with each firmware: every answer and the state compared with a model."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from qlinkgen.codecs import qlink
from tests.firmware.firmware import PROGRAM_SIZE, TARGETS
from tests.firmware.fixtures import BuildFirmware, FirmwareLines
from tests.firmware.line import FirmwareLine
from tests.soak import firmware as soak
from tests.soak import firmware_run
from tests.soak.firmware_model import Model
from tests.soak.firmware_page import TITLE, as_text, put_into
from tests.soak.firmware_run import Result, Soak, WrongAnswer
from tests.soak.firmware_traffic import REQUESTS, Traffic, Unit

#: `make soak` runs ten times as many.
TRANSACTIONS = 2_000


@pytest.mark.parametrize("target", TARGETS)
def test_mixed_transactions_among_damage_strays_and_noise(target: str, firmware_line: FirmwareLines) -> None:
    result = Soak(target, firmware_line(target), seed=5).run(TRANSACTIONS)
    print(as_text(result))
    assert result.transactions >= TRANSACTIONS
    assert set(result.asked) == set(REQUESTS), "every command was asked"
    assert min(result.asked.values()) >= 8
    assert result.answered > 0.6 * TRANSACTIONS
    for kind, least in (("corrupted", 200), ("malformed", 100), ("stray", 100), ("noise", 100)):
        assert result.sent[kind] > least
    assert result.effective < 0.2 * sum(result.sent.values()) - result.sent["request"] / 10
    assert result.comparisons >= TRANSACTIONS // firmware_run.COMPARED


def unit_stream(seed: int, count: int) -> tuple[list[Unit], Model]:
    """The units of a seed, without a firmware."""
    model = Model(PROGRAM_SIZE, number=3, rate=0)
    traffic = Traffic(random.Random(seed), PROGRAM_SIZE, delays=True)
    units = []
    for _ in range(count):
        for unit in (*traffic.disturbances(model.node), traffic.request(model.node, model.motion_counter)):
            units.append(unit)
            acknowledged = bool(model.hear(unit.data))
            if unit.kind == "request" and unit.name == firmware_run.PROGRAM_LOAD:
                traffic.loader.told(acknowledged=acknowledged)
    return units, model


def test_a_seed_always_makes_the_same() -> None:
    assert unit_stream(1, 300)[0] == unit_stream(1, 300)[0] != unit_stream(2, 300)[0]


def test_the_mix_has_what_it_is_to_have() -> None:
    units, model = unit_stream(1, 6000)
    counts = model.node.statistics
    assert counts.duplicates > 50
    assert counts.jumps > 50
    assert counts.overruns > 50, "motions with more words than fit"
    assert counts.program_pieces > 200
    assert counts.repeated_pieces > 30
    assert counts.refused_pieces > 100
    assert counts.refused_presets > 5
    assert counts.resets > 20
    requests = b"".join(unit.data for unit in units if unit.kind == "request")
    assert requests.count(b"\xa5\x00") > len(units) // 2, "many bytes are stuffed"
    decoder = qlink.StreamDecoder("request")
    for unit in units:
        decoder.feed(unit.data)
    assert {"crc", "length", "stuffing", "unknown"} <= set(decoder.counters.faults)


# The soak finds errors -------------------------------------------------------------------------------------


class Faulty(FirmwareLine):
    """A line with an error at one request, but not at diagnostic ones."""

    BEHIND = 200
    written = 0
    inside = False
    done = False

    def _exchange_behind(self, data: bytes) -> tuple[list[bytes], bytes]:
        self.inside = True
        try:
            return super()._exchange_behind(data)
        finally:
            self.inside = False

    def write(self, data: bytes) -> None:
        self.written += not self.inside  # the number of requests until a motor is at rest depends on time
        if self.written >= self.BEHIND and not self.inside and not self.done and self.is_request(data):
            self.done = True
            data = self.instead_of(data)
        super().write(data)

    def is_request(self, data: bytes) -> bool:
        events = qlink.StreamDecoder("request").feed(data)
        return any(isinstance(event, qlink.Message) and event.node == self.number for event in events)

    def instead_of(self, data: bytes) -> bytes:
        """The bytes to send instead."""
        return data


class Changed(Faulty):
    """A bit of an answer is changed."""

    def next_answer(self, timeout: float) -> bytes | None:
        answer = super().next_answer(timeout)
        if answer is None or self.inside or not self.done:
            return answer
        return answer[:3] + bytes((answer[3] ^ 1,)) + answer[4:]


class Secret(Faulty):
    """A damaged frame is handled as a sync."""

    def instead_of(self, data: bytes) -> bytes:
        return data + qlink.NodeSyncRequest(node=0, counter=77).to_frame()


class Talkative(Faulty):
    """A damaged request is answered."""

    def instead_of(self, data: bytes) -> bytes:
        return qlink.LoopBackRequest(node=self.number, data=b"?").to_frame() + data


class Lost(Faulty):
    """A request never arrives."""

    def instead_of(self, data: bytes) -> bytes:
        return b""


@pytest.mark.parametrize(
    ("kind", "complaint"),
    [
        (Changed, "the answer was .*; .* was due"),
        (Secret, "counters: .*syncs="),
        (Talkative, "the answer was .*; .* was due|without a request"),
        (Lost, "no answer in|counters: .*requests=|did not answer"),
    ],
)
def test_what_is_wrong_is_found_and_shown(
    kind: type[FirmwareLine], complaint: str, firmware_line: FirmwareLines, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(firmware_run, "HANGS", 1.0)
    monkeypatch.setattr("tests.firmware.line.HANGS", 1.0)
    usual = firmware_line("posix")
    line = kind(usual.port)
    line.number = usual.number
    usual.broken = True  # the next test gets a new one in any case
    with pytest.raises(WrongAnswer, match=complaint) as caught:
        Soak("posix", line, seed=1).run(600)
    assert str(caught.value).startswith("posix, seed 1, after ")
    assert str(caught.value).count("a5 a5") >= 4, "the last units are shown"


# The program ----------------------------------------------------------------------------------------------


@pytest.fixture
def posix(build_firmware: BuildFirmware) -> list[str]:
    """Arguments for the posix port, as built for the other tests."""
    program = build_firmware("posix", "qlink_node", TARGETS["posix"].options)
    return ["--targets", "posix", "--build", str(program.parent)]


def test_the_program_writes_a_section_and_only_that(
    posix: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "soak.md"
    page.write_text("# Soak\n\nText.\n")
    arguments = [*posix, "--transactions", "200", "--output", str(page)]
    assert soak.main(arguments) == 0
    first = page.read_text()
    assert first.startswith(f"# Soak\n\nText.\n\n{TITLE}\n")
    assert "| transactions | 20" in first
    assert "all well" in capsys.readouterr().out
    assert soak.main(arguments) == 0
    assert page.read_text().count(TITLE) == 1
    page.write_text(page.read_text() + "\n## Another\n\nStays.\n")
    assert put_into(page.read_text(), [Result("posix", 1)]).endswith("\n\n## Another\n\nStays.\n")


def test_the_program_says_no_where_something_is_wrong(
    posix: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    page = tmp_path / "soak.md"
    assert soak.main([*posix, "--output", str(page)]) == 2
    page.write_text("# Soak\n")
    monkeypatch.setattr("tests.firmware.line.FirmwareLine", Secret)
    assert soak.main([*posix, "--transactions", "600", "--output", str(page)]) == 1
    assert page.read_text() == "# Soak\n"
    assert "posix, seed 1, after" in capsys.readouterr().err
