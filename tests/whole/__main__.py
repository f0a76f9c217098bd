"""Try random whole schemas: ``python -m tests.whole --seeds 0..99 [--jobs 2]``.

Prints a line with the seeds for each cause of a difference, and exits with 1 if there is any.
``--report FILE`` writes all differences with their schemas, ``--output PAGE`` the figures of a clean run.
``--pairs`` tries only seeds that together have every pair of features of all.
"""

from __future__ import annotations

import argparse
import shlex
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from tests.support.whole.pairs import cover
from tests.support.whole.schemas import generate
from tests.support.whole.trial import Effort, Outcome, run

#: With `--names mixed`, one in this number of schemas has hostile names and texts.
_HOSTILE = 2
#: Number of schemas between lines of progress.
_STEP = 50

_PAGE = """\
# Soak: whole random schemas

A seed gives a schema: a frame of any parts, its bus, and messages of fields of every kind, with bounds
at their edges; every second one has hostile names and texts. What lint accepts is planned and generated
for every target. gcc and clang take its header, and those of a slave and a master alone, without a
warning as C99, C11 and C++17; both build and run the conformance kit. Random messages are encoded and
decoded by the interpreter of the plan, the Python module, the construct structures (live and as printed)
and the C header, and compared with an independent implementation that reads the YAML itself
(`tests/support/whole/reference`). So are wrong frames with the kind of their fault, and the events of
damaged streams, in Python also cut at random.

`make soak-schemas` runs it and writes this page; the last time it was

```
{command}
```

({minutes} minutes). The tests run fewer schemas of the same kind.

|  |  |
| --- | --- |
{table}"""


@dataclass(frozen=True)
class _Arguments:
    seeds: Sequence[int]
    jobs: int
    names: str
    effort: Effort
    report: Path | None
    output: Path | None
    show: bool
    stop: bool
    pairs: bool
    command: str


def main(words: Sequence[str] | None = None) -> int:
    """Run the trials of a command line."""
    arguments = _chosen(_parsed(words))
    if arguments.show:
        for seed in arguments.seeds:
            print(generate(seed, hostile=is_hostile(seed, arguments.names)))
        return 0
    for path in (arguments.report, arguments.output):
        if path:
            path.parent.mkdir(parents=True, exist_ok=True)
    begun = time.monotonic()
    trial = partial(_trial, names=arguments.names, effort=arguments.effort)
    outcomes = []
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for outcome in pool.map(trial, arguments.seeds):
            outcomes.append(outcome)
            if arguments.report:
                different = [each.report() for each in outcomes if each.differences]
                arguments.report.write_text("\n\n".join(different), "utf-8")
            if len(outcomes) % _STEP == 0:
                print(f"{len(outcomes)} schemas, {time.monotonic() - begun:.0f} s", flush=True)
            if arguments.stop and outcome.differences:
                pool.shutdown(cancel_futures=True)
                break
    seconds = time.monotonic() - begun
    print(summary(outcomes))
    print(f"{seconds:.0f} s")
    failed = any(each.differences for each in outcomes)
    if arguments.output and not failed:
        arguments.output.write_text(page(outcomes, arguments.command, seconds), "utf-8")
    return int(failed)


def _chosen(arguments: _Arguments) -> _Arguments:
    """With `--pairs`, as few of the seeds as have every pair of features that any schema has."""
    if not arguments.pairs:
        return arguments
    names = arguments.names
    found = cover({seed: generate(seed, hostile=is_hostile(seed, names)) for seed in arguments.seeds})
    print(found.text, flush=True)
    return replace(arguments, seeds=found.seeds)


def is_hostile(seed: int, names: str) -> bool:
    """Whether the schema of a seed has hostile names and texts."""
    return names == "hostile" or (names == "mixed" and seed % _HOSTILE == _HOSTILE - 1)


def _trial(seed: int, names: str, effort: Effort) -> Outcome:
    return run(seed, hostile=is_hostile(seed, names), effort=effort)


def summary(outcomes: Sequence[Outcome]) -> str:
    """Numbers of rejected schemas by reason, and causes of differences with their seeds."""
    refused: dict[str, list[int]] = defaultdict(list)
    causes: dict[tuple[str, str, str], list[int]] = defaultdict(list)
    for outcome in outcomes:
        for rule in outcome.refused:
            refused[rule].append(outcome.seed)
        for each in outcome.differences:
            causes[each.stage, each.who, each.cause].append(outcome.seed)
    lines = [f"refused by lint, {rule}: {_seeds(seeds)}" for rule, seeds in sorted(refused.items())]
    lines += [
        f"{stage}, {who}: {cause}: {_seeds(seeds)}" for (stage, who, cause), seeds in sorted(causes.items())
    ]
    counted = ("messages", "frames", "streams")
    tried = [f"{sum(getattr(each, name) for each in outcomes)} {name}" for name in counted]
    lines.append(
        f"{len(outcomes)} schemas, {sum(bool(each.refused) for each in outcomes)} refused by lint, "
        f"{sum(bool(each.differences) for each in outcomes)} with differences; {', '.join(tried)}, "
        f"{sum(each.compared for each in outcomes)} comparisons"
    )
    return "\n".join(lines)


def page(outcomes: Sequence[Outcome], command: str, seconds: float) -> str:
    """The figures of trials without a difference, as a page of the documentation."""
    taken = [each for each in outcomes if not each.refused]
    rules = Counter(rule for each in outcomes for rule in each.refused)
    shapes = Counter(each.traits.split()[0] for each in taken)
    refused = ", ".join(f"{rule} {number}" for rule, number in sorted(rules.items()))
    rows = {
        "schemas": len(outcomes),
        "... refused by lint": f"{len(outcomes) - len(taken)} ({refused})",
        "... with hostile names and texts": sum(each.hostile for each in taken),
        "... whose receiver hunts, searches, follows marks, counts packets": ", ".join(
            str(shapes[each]) for each in ("hunt", "search", "marked", "packets")
        ),
        "messages encoded by each output": sum(each.messages for each in taken),
        "frames decoded by each output, right and wrong": sum(each.frames for each in taken),
        "streams received, right and damaged": sum(each.streams for each in taken),
        "comparisons": sum(each.compared for each in taken),
        "differences": sum(len(each.differences) for each in taken),
    }
    table = "".join(f"| {name} | {value} |\n" for name, value in rows.items())
    return _PAGE.format(command=command, minutes=round(seconds / 60), table=table)


def _seeds(seeds: Sequence[int]) -> str:
    return f"{len(seeds)} schemas, seeds {', '.join(map(str, seeds[:6]))}{' ...' if len(seeds) > 6 else ''}"


def _parsed(words: Sequence[str] | None) -> _Arguments:
    parser = argparse.ArgumentParser(
        prog="python -m tests.whole", description="Trials of whole random schemas."
    )
    parser.add_argument(
        "--seeds", type=_seeds_of, required=True, help="first..last, or numbers and ranges with commas"
    )
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--names", choices=("ordinary", "hostile", "mixed"), default="mixed")
    parser.add_argument("--messages", type=int, default=Effort.messages, help="of each kind, for each schema")
    parser.add_argument(
        "--streams", type=int, default=Effort.streams, help="of each direction, for each schema"
    )
    parser.add_argument("--uncompiled", action="store_true", help="leave out the compilers and the kit")
    parser.add_argument("--every", action="store_true", help="every compiler, standard and role")
    parser.add_argument("--output", type=Path, help="page for the figures, unless there are differences")
    parser.add_argument("--report", type=Path, help="file for every difference with its schema")
    parser.add_argument("--show", action="store_true", help="print the schemas alone")
    parser.add_argument(
        "--pairs", action="store_true", help="only seeds that together have every pair of features of all"
    )
    parser.add_argument("--stop", action="store_true", help="try no more seeds after a difference")
    given = parser.parse_args(words)
    effort = Effort(given.messages, given.streams, uncompiled=given.uncompiled, every=given.every)
    command = shlex.join(["python", "-m", "tests.whole", *(sys.argv[1:] if words is None else words)])
    return _Arguments(
        given.seeds,
        given.jobs,
        given.names,
        effort,
        given.report,
        given.output,
        given.show,
        given.stop,
        given.pairs,
        command,
    )


def _seeds_of(text: str) -> Sequence[int]:
    seeds: list[int] = []
    for each in text.split(","):
        first, _, last = each.partition("..")
        seeds += range(int(first), int(last or first) + 1)
    return seeds


if __name__ == "__main__":
    sys.exit(main())
