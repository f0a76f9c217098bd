"""What a soak has found, as text for the terminal and as docs/soak.md."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.report import as_markdown
from qlinkgen.sim.fault_kinds import KINDS
from tests.soak.bus_run import LATE, PTY_LATE, PTY_SLACK, SHARE, SLACK, Result

_SEEN_AS = {
    "drop": "a timeout; of a request that nothing answers, not at all",
    "flip": "a damaged frame, or bytes outside frames, and a timeout",
    "truncate": "a damaged frame, or bytes outside frames, and a timeout",
    "delay": "nothing: the answer is right and in time",
    "late": "a timeout, and a late stray while the line is watched",
    "duplicate": "a collision and a timeout, or a stray",
    "stray": "a stray, or a collision",
    "noise": "bytes outside frames, or a damaged frame",
    "silent": "timeouts, one for each answer that was swallowed",
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
        ("... that nothing answers", _n(account.outcomes["told"])),
        ("... failed with a LinkError", _n(total.failures)),
        ("refused, since the node was offline", _n(account.outcomes["refused"])),
        ("requests on the line, repeats among them", f"{_n(total.requests)}, {_n(total.repeats)}"),
        ("seconds on the clock of the bus", _n(round(result.seconds))),
        ("faults injected", _n(result.counts.total)),
        ("collisions", _n(result.collisions)),
        ("timeouts", _n(total.timeouts)),
        ("damaged frames, strays, late among these", f"{_n(damaged)}, {_n(total.strays)}, {_n(total.late)}"),
        ("wrong answers accepted", _n(len(account.wrong))),
        ("frames that nobody sent and that passed the CRC", _n(account.forged + result.forged_requests)),
        ("words of path queued, lost or queued twice", f"{_n(result.words)}, {none}"),
        ("pieces of programs stored, lost or stored twice", f"{_n(result.pieces)}, {none}"),
        ("repeats that a node recognised and did not take again", _n(result.repeats)),
        ("faults that nobody has counted", _n(account.unseen.total())),
        ("timeouts without a cause", _n(len(account.unexplained))),
        ("longest call, of its worst case", f"{100 * account.slowest:.1f} %"),
        ("digest of the log", account.digest if account.paced else "not the same twice: real time"),
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

Five simulated nodes on one line, one of them with a cut cable every now and then (it hears nothing, or
nobody hears it), one that does not support every command, and a master that asks all commands of the
document in random order: motions and streams of motion, loads of programs, settings, new node numbers,
inputs and outputs, resets, questions to nodes that are not there. Each transmission meets each of the nine
kinds of faults with a chance of {share} %, so that 5 % of the answers are hit.

`make soak` runs it and writes this page; the last time it was

```
{command}
```

({took}). The tests run the same code, shorter.

## Figures

{figures}

What each row stands on:

- *Wrong answers accepted*: each node writes down what it answers to which question. An answer that the
  master takes has to be one that was given to this very question, and its values have to be those of the
  model.
- *Words*: the words that a node has queued are compared with those that the calls have handed over, after
  every call. After a call that failed, those that are `pending` may have been queued or not; the next call
  has to settle it.
- *Pieces*: after a load the node holds the text, byte for byte; after one that failed, a beginning of it.
- *Frames that nobody sent*: a CRC of 16 bits lets one in 65536 of the badly damaged frames pass, whoever
  looks. The nodes of the soak recognise such a request and ignore it, and such an answer is counted here,
  not as a wrong one.
- *Longest call*: the time that each call took, divided by `Timing.worst_case` of its command.
- *Digest*: of every frame sent and heard, with its time. On the virtual clock a seed always gives the same
  one.

## Every fault is counted

{faults}

For each fault that was injected the soak waits for something to be counted, at the latest four transactions
later: a timeout, a stray, a damaged frame, bytes outside frames, or a repeat that a node has recognised.
Exempt are `delay`, `late` where the answer of a node_program_load is still in time, and the loss of
requests that nothing answers (node_start, node_stop, node_sync), which a master cannot notice. The other
way round each timeout has to have a cause: a fault, a collision, a node that is not there or does not
answer this.

These sums have to be equal at the end:

{equations}

The last one may differ by the byte that is inserted behind a checksum ending in A5 where the frame in front
of it is damaged: it belongs to no frame then. Over a pty there is no baud rate, so two requests may arrive
in one piece and the transmissions of the master are not compared; and since other programs may have the
processor, a timeout needs no other cause there, and no call has to be in time.

## What no master can tell apart

An answer to a question carries the node and the command. Only motion and node_program_load repeat the
number of the question as well, loop_back its data and read, in a way, its size. So an answer to
motor_position that comes when the same node has been asked motor_position *again* cannot be told from the
answer to the second question: by no master, as the bytes are the same. What the master does about it is
time. After a timeout it wants the line to be quiet for three byte times and the host slack before it asks
again, so an answer that is late by less than deadline + quiet is heard as a stray. The host slack here is
{slack} ms on the virtual clock and {pty_slack} ms over the pty, and `late` answers are {late} ms late,
{pty_late} ms over the pty: too late for the deadline, and within the silence. An answer that is later still
meets the next attempt of the same call, for which it is right, or a question of its own kind: then a
position may be an old one. Words and programs stay safe even then, since a node takes a number once and the
master goes on only with the answer to that number; tests/qlink/test_late.py proves it with answers that are
late by any time.

For the same reason a copy of a transmission follows at once: a copy of a request that came behind the
next request would be done after it, and no slave could know.

Strays are valid answers that are not an answer to the question under way, for the same reason. None of them
is a frame that a node could take for a request: nothing in a frame tells the two apart, and an answer to
clear_fifo, node_reset, write_read, loop_back or the opening of a load *is* a request for its node, to the
last bit.
"""
