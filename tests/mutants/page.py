"""docs/mutants.md: figures of a run, and each survivor with its reason."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import yaml

from tests.mutants.drawing import Mutant
from tests.mutants.killing import STAGES, Result

REASONS = Path(__file__).with_name("survivors.yaml")
#: What the page says of a survivor without a reason.
UNEXPLAINED = "no reason known: add a test, or the reason to tests/mutants/survivors.yaml"

_PAGE = """\
# Mutants

{number} mutants of `qlinkgen/plan` and `qlinkgen/model`, drawn with seed {seed} from {places} places where
cosmic-ray changes the code. Each is tried against the tests below. {killed} are killed, {share} %.
`tests/mutants/__main__.py` says what is not drawn, and why.{stopped}

`make mutants` runs it and writes this page; the last run was

```
{command}
```

({minutes} minutes of tests). A stage runs only on mutants that passed the previous stages. It also fails if
it takes more than five times as long as without a mutant, and 20 seconds: {late} of the killed.

{stages}
{modules}
Three changes that no test noticed once have tests of their own now: in `tests/schema/test_numbers.py` the
lower bound of a default, in `tests/plan/test_sizes.py` the address and the id in the worst-case size.

## Survivors

{survivors}"""

_COMMANDS = {name: "python " + " ".join(words) for name, words in STAGES.items()}


@dataclass(frozen=True)
class Reason:
    """Why some mutants need not be killed. A key that is not given matches every mutant."""

    why: str
    module: str | None = None
    definition: str | None = None
    was: str | None = None
    now: str | None = None

    def fits(self, mutant: Mutant) -> bool:
        """Whether this is the reason of a mutant, on whatever line it is."""
        pairs = (
            (self.module, mutant.module),
            (self.definition, mutant.place.definition),
            (self.was, mutant.was),
            (self.now, mutant.now),
        )
        return all(wanted in (None, seen) for wanted, seen in pairs)


def reasons(path: Path = REASONS) -> list[Reason]:
    """The reasons of a file."""
    return [Reason(**each) for each in yaml.safe_load(path.read_text("utf-8"))]


def reason_of(mutant: Mutant, known: Sequence[Reason]) -> str:
    """Why a mutant survives, or that this is not known."""
    return next((each.why for each in known if each.fits(mutant)), UNEXPLAINED)


@dataclass(frozen=True)
class Run:
    """The mutants that were tried, of so many drawn, and their results."""

    command: str
    seed: int
    places: int
    drawn: int
    mutants: Sequence[Mutant]
    results: Mapping[str, Result]

    @property
    def survivors(self) -> list[Mutant]:
        """Mutants that no stage killed."""
        return [each for each in self.mutants if self.results[each.place.id].stage is None]


def text(run: Run, known: Sequence[Reason]) -> str:
    """The page."""
    results = [run.results[each.place.id] for each in run.mutants]
    killed = len(results) - len(run.survivors)
    rest = run.drawn - len(results)
    return _PAGE.format(
        number=len(results),
        stopped=f" The run was stopped before it tried {rest} more of those drawn." if rest else "",
        places=run.places,
        seed=run.seed,
        killed=killed,
        share=f"{100 * killed / len(results):.1f}",
        command=run.command,
        minutes=round(sum(each.seconds for each in results) / 60),
        late=sum(each.late for each in results),
        stages=_stages(results),
        modules=_modules(run),
        survivors=_survivors(run.survivors, known),
    )


def _stages(results: Sequence[Result]) -> str:
    killed = Counter(each.stage for each in results)
    rows = [[name, f"`{command}`", str(killed[name])] for name, command in _COMMANDS.items()]
    return _table(["stage", "command", "killed"], rows)


def _modules(run: Run) -> str:
    drawn = Counter(each.module for each in run.mutants)
    left = Counter(each.module for each in run.survivors)
    rows = [[f"`{name}`", str(count), str(count - left[name])] for name, count in sorted(drawn.items())]
    return _table(["module", "drawn", "killed"], rows)


def _survivors(mutants: Sequence[Mutant], known: Sequence[Reason]) -> str:
    rows = [
        [f"`{each.module}:{each.line}`", _code(each.was), _code(each.now), reason_of(each, known)]
        for each in mutants
    ]
    return _table(["place", "is", "mutated to", "reason"], rows)


def _code(line: str) -> str:
    return f"`` {line} ``" if line else "(removed)"


def _table(names: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of Markdown; a bar would end a cell."""
    lines = [names, ["---"] * len(names), *rows]
    return "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |\n" for cells in lines)
