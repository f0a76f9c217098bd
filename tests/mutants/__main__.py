"""Mutation testing of plan/ and model/: ``python -m tests.mutants [--number 500] [--output PAGE]``.

cosmic-ray says where a module can be changed. 500 of these changes are drawn, and the stages of
`tests.mutants.killing` run on each, in a copy of the tree, until one fails. A mutant that every stage passes
needs a test, or a reason in `survivors.yaml`; one with neither ends the program with 1.

Not drawn, because tests cannot or should not tell them from the original:

- text that is not Python: `*` before keyword-only parameters and `|` of patterns are operators to cosmic-ray;
- differences in annotations, docstrings or unions of types (`A | B`) alone, which only type checkers read;
- `frozen`, `slots` and `kw_only` of dataclasses: they forbid what mypy forbids too;
- `is` in place of `==` or the reverse, `is not` in place of `!=` or the reverse: both sides are enumerations,
  None or small integers, which are the same object exactly where they are equal.

The draw depends on the seed and, for each place, on its function and its line alone, so an edit changes the
sample only where it changes code. Results are kept in build/mutants.jsonl; ``--keep`` goes on from there, and
tries only new mutants and survivors without a reason, as after a new test.
"""

from __future__ import annotations

import argparse
import json
import queue
import shlex
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

from tests.mutants import drawing, killing, page
from tests.mutants.drawing import Mutant
from tests.mutants.killing import Result

ROOT = Path(__file__).parents[2]
PACKAGES = ("qlinkgen/model", "qlinkgen/plan")


def main(words: Sequence[str] | None = None) -> int:
    """Draw mutants and judge them as a command line asks."""
    given = _parser().parse_args(words)
    files = [path for name in PACKAGES for path in sorted((ROOT / name).glob("*.py"))]
    places = list(drawing.candidates(ROOT, [str(path.relative_to(ROOT)) for path in files]))
    mutants = drawing.draw(ROOT, places, given.number, given.seed)
    print(f"{len(mutants)} of {len(places)} places drawn", flush=True)
    given.results.parent.mkdir(parents=True, exist_ok=True)
    known = page.reasons()
    results = settled(given.results, mutants, known) if given.keep else {}
    left = [each for each in mutants if each.place.id not in results]
    with (
        given.results.open("a" if given.keep else "w", encoding="utf-8") as file,
        suppress(KeyboardInterrupt),
    ):
        for mutant, result in zip(left, _judged(left, given.jobs), strict=True):
            results[result.id] = result
            print(json.dumps(asdict(result)), file=file, flush=True)
            print(_line(mutant, result), flush=True)
    tried = [each for each in mutants if each.place.id in results]
    command = shlex.join(["python", "-m", "tests.mutants", *(sys.argv[1:] if words is None else words)])
    run = page.Run(command, given.seed, len(places), len(mutants), tried, results)
    if given.output and tried:
        given.output.write_text(page.text(run, known), "utf-8")
    unexplained = [each for each in run.survivors if page.reason_of(each, known) == page.UNEXPLAINED]
    print(f"{len(run.survivors)} of {len(tried)} survive, {len(unexplained)} without a known reason")
    if len(tried) < len(mutants):
        print(f"stopped; --keep goes on with the other {len(mutants) - len(tried)}")
    return int(bool(unexplained) or len(tried) < len(mutants))


def settled(path: Path, mutants: Sequence[Mutant], known: Sequence[page.Reason]) -> dict[str, Result]:
    """Results of an earlier run that no new test can change: killed, or survived with a reason."""
    lines = path.read_text("utf-8").splitlines() if path.exists() else []
    results = {each.id: each for each in (Result(**json.loads(line)) for line in lines)}
    explained = {each.place.id for each in mutants if page.reason_of(each, known) != page.UNEXPLAINED}
    return {name: each for name, each in results.items() if each.stage or name in explained}


def _judged(mutants: Sequence[Mutant], jobs: int) -> Iterator[Result]:
    """The results of mutants in their order, each job in a copy of its own."""
    if not mutants:
        return
    with tempfile.TemporaryDirectory() as base, ThreadPoolExecutor(jobs) as pool:
        folders: queue.SimpleQueue[Path] = queue.SimpleQueue()
        first, *others = [killing.copied(ROOT, Path(base, str(number))) for number in range(jobs)]
        stages = killing.fit(first)
        for folder in (first, *others):
            folders.put(folder)

        def judge(mutant: Mutant) -> Result:
            folder = folders.get()
            try:
                return killing.judged(folder, stages, mutant)
            finally:
                folders.put(folder)

        try:
            yield from pool.map(judge, mutants)
        finally:
            pool.shutdown(cancel_futures=True)
        killing.check(first, stages)


def _line(mutant: Mutant, result: Result) -> str:
    verdict = f"killed by {result.stage}" if result.stage else "SURVIVES"
    late = " (endless)" if result.late else ""
    return f"{mutant.module}:{mutant.line}: {mutant.was} -> {mutant.now}: {verdict}{late}, {result.seconds} s"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m tests.mutants", description="Mutation testing of plan/ and model/."
    )
    parser.add_argument("--number", type=int, default=500, help="mutants to draw (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the draw (default: %(default)s)")
    parser.add_argument("--jobs", type=int, default=1, help="mutants at a time (default: %(default)s)")
    parser.add_argument("--keep", action="store_true", help="try again only survivors without a reason")
    parser.add_argument("--results", type=Path, default=ROOT / "build/mutants.jsonl", metavar="FILE")
    parser.add_argument("--output", type=Path, metavar="PAGE", help="page for the figures")
    return parser


if __name__ == "__main__":
    sys.exit(main())
