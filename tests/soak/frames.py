"""Mutated frames of the shipped protocols, as each output sees them: ``python -m tests.soak.frames``.

Each frame is that of a random message with bytes changed, lost or added, or a correct frame around a wrong
payload. The interpreter of the plan, the generated Python, the C header and the tests' own implementation,
which reads the YAML itself, must return the same values or the same kind of fault.
"""

from __future__ import annotations

import argparse
import itertools
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from qlinkgen.backends import python
from qlinkgen.plan import Options, plan_of
from qlinkgen.schema import find, load, shipped
from tests.support.cdriver import Driver, build
from tests.support.whole import chance
from tests.support.whole.reference import Reference, Seen, Wrong
from tests.support.whole.reference.layouts import Message
from tests.support.whole.targets import CTarget, InterpreterTarget, PythonTarget, Target, printed_codec

#: Frames per batch of one process.
_BATCH = 50_000
_MOST_SHOWN = 20

_PAGE = """\
# Soak: mutated frames

Random messages of the shipped protocols, their frames with bytes changed, lost or added, and correct frames
around wrong payloads. The generated Python, the C header (gcc -O1), the interpreter of the plan and an
independent implementation that reads the YAML itself decode each, and must return the same values or the
same kind of fault. Written by `make soak-frames`; the last run:

```
{command}
```

| protocol | frames | accepted | {kinds} | differences |
| --- | ---: | ---: | {rules} | ---: |
{rows}
"""


@dataclass(frozen=True, slots=True)
class Trial:
    """A protocol and the seed of a batch."""

    protocol: str
    seed: int
    frames: int


@dataclass
class Tally:
    """Counts of frames by message or kind of fault, and the differences between outputs."""

    found: Counter[str] = field(default_factory=Counter)
    differences: list[str] = field(default_factory=list)

    def add(self, other: Tally) -> None:
        """Add another batch."""
        self.found += other.found
        self.differences += other.differences


def mutated(reference: Reference, rng: random.Random) -> Iterator[tuple[Message, bytes, bytes]]:
    """Endless frames, each with its original message and its request."""
    while True:
        message = rng.choice(reference.messages)
        request = chance.request(reference, message, rng)
        given = chance.values(message, rng, chance.mark(reference))
        payload, wire = reference.encode(message.name, given, chance.address(message, rng), request)
        wrong = chance.wrong_frames(reference, message, payload, wire, rng, request=request)
        yield from ((message, frame, request) for frame in (wire, *wrong))


def decoded(target: Target | Reference, message: Message, wire: bytes, request: bytes) -> Seen | str:
    """The message that an output decodes, or the kind of fault."""
    try:
        if isinstance(target, Reference):
            return target.decode(target.direction_of(message), wire, request)
        return target.decode(message, wire, request)
    except Wrong as wrong:
        return wrong.kind


def run(trial: Trial) -> Tally:
    """Compare a batch of frames."""
    path = find(trial.protocol)
    protocol, reference = load(path), Reference(Path(path).read_text("utf-8"))
    rng, tally = random.Random(f"{trial.protocol} {trial.seed}"), Tally()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with Driver(build(protocol, folder, "gcc", ("-O1", "-std=c99"))) as driver:
            targets: list[Target] = [
                InterpreterTarget(reference, plan_of(protocol)),
                PythonTarget(reference, printed_codec(python.generate(protocol, Options()), folder)),
                CTarget(reference, driver),
            ]
            for message, wire, request in itertools.islice(mutated(reference, rng), trial.frames):
                expected = decoded(reference, message, wire, request)
                tally.found["accepted" if isinstance(expected, Seen) else expected] += 1
                asked = reference.by_name[expected.name] if isinstance(expected, Seen) else message
                for target in targets:
                    seen = decoded(target, asked, wire, request)
                    if seen != expected:
                        after = f" after {request.hex()}" if request else ""
                        about = f"{trial.protocol} {message.name} {wire.hex()}{after}"
                        tally.differences.append(f"{about}: {target.name} has {seen}, not {expected}")
    return tally


def main(words: list[str] | None = None) -> int:
    """Run the soak; 1 if outputs differ."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=1_000_000, help="for each protocol")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, help="page for the figures, if nothing differs")
    arguments = parser.parse_args(words)
    names = [Path(each).stem for each in shipped()]
    trials = [
        Trial(name, arguments.seed + start, min(_BATCH, arguments.frames - start))
        for name in names
        for start in range(0, arguments.frames, _BATCH)
    ]
    tallies, begun = {name: Tally() for name in names}, time.monotonic()
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for trial, tally in zip(trials, pool.map(run, trials), strict=True):
            tallies[trial.protocol].add(tally)
    differences = [each for tally in tallies.values() for each in tally.differences]
    print(*differences[:_MOST_SHOWN], sep="\n")
    for name, tally in tallies.items():
        counts = ", ".join(f"{kind} {number}" for kind, number in tally.found.most_common())
        print(f"{name}: {tally.found.total()} frames ({counts}), {len(tally.differences)} differences")
    print(f"{time.monotonic() - begun:.0f} s")
    if arguments.output and not differences:
        command = f"python -m tests.soak.frames --frames {arguments.frames} --seed {arguments.seed}"
        arguments.output.write_text(_page(command, tallies), "utf-8")
    return int(bool(differences))


def _page(command: str, tallies: dict[str, Tally]) -> str:
    kinds = sorted({kind for tally in tallies.values() for kind in tally.found} - {"accepted"})
    rows = [
        " | ".join([f"| {name}", *(f"{number:,}" for number in numbers), f"{len(tally.differences)} |"])
        for name, tally in tallies.items()
        for numbers in [[tally.found.total(), *(tally.found[kind] for kind in ("accepted", *kinds))]]
    ]
    rules = " | ".join(["---:"] * len(kinds))
    return _PAGE.format(command=command, kinds=" | ".join(kinds), rules=rules, rows="\n".join(rows))


if __name__ == "__main__":
    sys.exit(main())
