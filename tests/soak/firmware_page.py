"""The results of the firmware soak, as text for the terminal and as a section of docs/soak.md."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.report import as_markdown
from tests.soak.firmware_run import COMPARED, PHASE, Result
from tests.soak.sections import put_section

TITLE = "## Firmware on emulated chips"
_BORN = {
    "posix": "a process",
    "lm3s6965evb": "QEMU, Cortex-M3",
    "microbit": "QEMU, Cortex-M0",
    "atmega328p": "simavr, AVR",
}


def as_text(result: Result) -> str:
    """A few lines for the terminal."""
    verdict = "WRONG" if result.complaint else "all well"
    head = f"{result.target}, seed {result.seed}: {verdict}; {result.seconds:.0f} s"
    return "\n".join([head, *(f"  {name}: {value}" for name, value in _figures(result))])


def _figures(result: Result) -> list[tuple[str, str]]:
    sent = result.sent
    return [
        ("runs as", _BORN[result.target]),
        ("transactions", _n(result.transactions)),
        ("... answered", _n(result.answered)),
        ("deliberately damaged requests", _n(sent["corrupted"])),
        ("frames with a correct checksum and any contents", _n(sent["malformed"])),
        ("requests to other nodes, and their answers", _n(sent["stray"])),
        ("noise, 1 to 20 bytes", _n(sent["noise"])),
        ("of these four: broadcasts, or valid requests", _n(result.effective)),
        ("comparisons of the whole state", _n(result.comparisons)),
        ("wrong answers, answers without a request, wrong states", "1" if result.complaint else "0"),
        ("transactions a second", _n(round(result.rate))),
    ]


def _n(number: int) -> str:
    return f"{number:,}".replace(",", " ")


def put_into(page: str, results: Sequence[Result]) -> str:
    """Return a page with this section, in place of the old one or at the end."""
    return put_section(page, TITLE, as_section(results))


def as_section(results: Sequence[Result]) -> str:
    """Return the section without its heading."""
    rows = [
        [cells[0][0], *(cell[1] for cell in cells)]
        for cells in zip(*(_figures(result) for result in results), strict=True)
    ]
    return _PAGE.format(
        count=results[0].wanted,
        seed=results[0].seed,
        phase=PHASE,
        compared=COMPARED,
        figures=as_markdown(["", *(result.target for result in results)], rows),
    )


_PAGE = """\
The slave of examples/firmware on each of its ports, over the serial line of its process or emulator. Each
receives a random mix of all commands, with many bytes of A5 and 00, repeated and wrong counters, full FIFOs,
and correct and broken programs; between them damaged requests, frames for other nodes, and noise. A virtual
node receives the same bytes: each answer of the firmware has to be that of the virtual node, byte for byte,
and the firmware must not answer if the virtual node does not. Every {compared} transactions the two are
compared internally: all counters, outputs, inputs, FIFO, position, path words, program. Every {phase} the
node is configured anew. The last run:

```
python -m tests.soak.firmware --transactions {count} --seed {seed} --output docs/soak.md
```

{figures}

Results do not depend on time: the soak waits for a moving motor, and delays from input 1 to output 1 are 0
while input 1 changes. Timed behaviour is tested by the behaviours shared by firmware and simulated nodes. The
emulators hold bytes back while a receive buffer is full, so overruns are not tested here, and the speed is
that of the emulator.
"""
