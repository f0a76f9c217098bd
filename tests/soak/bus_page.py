"""The results of a soak, as text for the terminal and as docs/soak.md."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.report import as_markdown
from qlinkgen.sim.fault_kinds import KINDS
from tests.soak.bus_run import LATE, PTY_LATE, PTY_SLACK, SHARE, SLACK, Result

_SEEN_AS = {
    "drop": "a timeout; of a request without an answer, not at all",
    "flip": "a damaged frame, or bytes outside frames, and a timeout",
    "truncate": "a damaged frame, or bytes outside frames, and a timeout",
    "delay": "nothing: the answer is correct and in time",
    "late": "a timeout, and a late stray while the line is watched",
    "duplicate": "a collision and a timeout, or a stray",
    "stray": "a stray, or a collision",
    "noise": "bytes outside frames, or a damaged frame",
    "silent": "timeouts, one for each lost answer",
}


def as_text(result: Result, seconds: float) -> str:
    """A few lines for the terminal."""
    verdict = "all well" if not result.complaints else "WRONG"
    lines = [f"{result.name}, seed {result.seed}: {verdict}; {seconds:.0f} s"]
    lines += [f"  {name}: {value}" for name, value in _figures(result)]
    lines += [
        f"  {each.left} = {each.right}: {each.values[0]}, {each.values[1]}" for each in result.equations
    ]
    return "\n".join(lines)


def _figures(result: Result) -> list[tuple[str, str]]:
    account, total = result.account, result.total
    damaged = sum(total.damaged.values())
    none = "0" if not result.complaints else "not known"  # the first one ends a soak
    return [
        ("transactions", _n(account.asked)),
        ("... answered", _n(account.outcomes["answered"])),
        ("... of commands without an answer", _n(account.outcomes["told"])),
        ("... failed with a LinkError", _n(total.failures)),
        ("refused, since the node was offline", _n(account.outcomes["refused"])),
        ("requests on the line, repeats among them", f"{_n(total.requests)}, {_n(total.repeats)}"),
        ("seconds on the clock of the bus", _n(round(result.seconds))),
        ("faults injected", _n(result.counts.total)),
        ("collisions", _n(result.collisions)),
        ("timeouts", _n(total.timeouts)),
        ("damaged frames, strays, late among these", f"{_n(damaged)}, {_n(total.strays)}, {_n(total.late)}"),
        ("wrong answers accepted", _n(len(account.wrong))),
        ("frames without a sender that passed the CRC", _n(account.forged + result.forged_requests)),
        ("words of path queued, lost or queued twice", f"{_n(result.words)}, {none}"),
        ("pieces of programs stored, lost or stored twice", f"{_n(result.pieces)}, {none}"),
        ("repeats recognised by a node and not taken again", _n(result.repeats)),
        ("faults not counted", _n(account.unseen.total())),
        ("timeouts without a cause", _n(len(account.unexplained))),
        ("longest call, share of its worst case", f"{100 * account.slowest:.1f} %"),
        ("digest of the log", account.digest if account.paced else "differs between runs: real time"),
    ]


def _n(number: int) -> str:
    return f"{number:,}".replace(",", " ")


def as_page(results: Sequence[Result], seconds: Sequence[float], command: str) -> str:
    """Return docs/soak.md."""
    names = [result.name for result in results]
    rows = [
        [cells[0][0], *(cell[1] for cell in cells)]
        for cells in zip(*(_figures(result) for result in results), strict=True)
    ]
    faults = [[kind, *(_n(result.counts[kind]) for result in results), _SEEN_AS[kind]] for kind in KINDS]
    equations = [
        [f"{each.left} = {each.right}", f"{_n(each.values[0])} = {_n(each.values[1])}"]
        for each in results[0].equations
    ]
    took = ", ".join(f"{name} {each:.0f} s" for name, each in zip(names, seconds, strict=True))
    return _PAGE.format(
        command=command,
        took=took,
        figures=as_markdown(["", *names], rows),
        faults=as_markdown(["fault", *names, "is counted as"], faults),
        equations=as_markdown([f"on the {results[0].name}", ""], equations),
        share=f"{100 * SHARE:.2f}",
        slack=f"{1e3 * SLACK:.0f}",
        pty_slack=f"{1e3 * PTY_SLACK:.0f}",
        late=f"{1e3 * LATE[0]:.0f} to {1e3 * LATE[1]:.0f}",
        pty_late=" to ".join(f"{1e3 * (PTY_SLACK + late):.0f}" for late in PTY_LATE),
    )


_PAGE = """\
# Soak: a million transactions on a bad line

Five simulated nodes on one line, one of them at times with a cut cable (it receives nothing, or its answers
are lost), one without support for some commands, and a master that sends all commands of the document in
random order: motions and streams of motion, loads of programs, settings, new node numbers, inputs and
outputs, resets, requests to nodes that do not exist. Each transmission is hit by each of the nine kinds of
faults with a chance of {share} %, so that 5 % of the answers are hit.

`make soak` runs it and writes this page; the last run:

```
{command}
```

({took}). The tests run the same code, with fewer transactions.

## Figures

{figures}

How the rows are checked:

- *Wrong answers accepted*: each node records its answers with their requests. An answer accepted by the
  master has to be one given to this request, and its values have to be those of the model.
- *Words*: after every call, the words queued by a node are compared with those passed to the calls. After a
  failed call, the `pending` words may have been queued or not; the next call has to settle it.
- *Pieces*: after a load the node holds the text, byte for byte; after a failed one, a beginning of it.
- *Frames without a sender*: one in 65536 badly damaged frames passes a CRC of 16 bits. The nodes of the soak
  recognise such a request and ignore it; such an answer is counted here, not as a wrong one.
- *Longest call*: the duration of each call, divided by `Timing.worst_case` of its command.
- *Digest*: of every frame sent and received, with its time. On the virtual clock it depends only on the seed.

## Every fault is counted

{faults}

Each injected fault must be counted within four transactions: as a timeout, a stray, a damaged frame, bytes
outside frames, or a repeat recognised by a node. Exempt are `delay`, `late` if the answer of a
node_program_load is still in time, and the loss of requests without an answer (node_start, node_stop,
node_sync), which a master cannot notice. Conversely each timeout must have a cause: a fault, a collision, a
node that does not exist or does not answer this command.

These sums have to be equal at the end:

{equations}

The last sums may differ by the bytes inserted after checksums ending in A5: after a damaged frame such a byte
belongs to no frame. A pty has no baud rate, so two requests may arrive in one piece, and the transmissions of
the master are not compared; since other programs may have the processor, a timeout over the pty may have no
other cause, and calls have no time limit.

## Answers that a master cannot distinguish

An answer carries the node and the command. Only motion and node_program_load repeat the number of the request
as well, loop_back its data, and read indirectly its size. So an answer to motor_position that is received
after the same node was sent motor_position *again* cannot be distinguished from the answer to the second
request: the bytes are the same. The master uses time instead. After a timeout it waits until the line is
quiet for three byte times plus the host slack before the next request, so an answer that is late by less than
deadline + quiet is counted as a stray. The host slack here is {slack} ms on the virtual clock and {pty_slack}
ms over the pty, and `late` answers are {late} ms late, {pty_late} ms over the pty: too late for the deadline,
and within the silence. An even later answer is accepted by the next attempt of the same call, for which it is
correct, or by a request of the same kind: then a position may be old. Words and programs are safe even then,
since a node takes a number once and the master continues only with the answer to that number;
tests/qlink/test_late.py proves it with answers of any delay.

For the same reason a copy of a transmission follows at once: a node would carry out a copy of a request
received after the next request, and could not detect it.

For the same reason strays are valid answers, but not to the current request. None of them could be read as a
request by a node: frames do not show their direction, and an answer to clear_fifo, node_reset, write_read,
loop_back or the opening of a load is identical to a request for its node.
"""
