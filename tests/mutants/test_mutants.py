"""The harness draws the same mutants again, kills what a test notices, and nothing else."""

from __future__ import annotations

import json
import os
import subprocess
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from tests.mutants import drawing, killing, page
from tests.mutants.__main__ import settled
from tests.mutants.drawing import Candidate, is_noise, mutant_of

ROOT = Path(__file__).parents[2]
_MODULE = "qlinkgen/plan/__init__.py"
_PLACE = Candidate(_MODULE, "double", "core/NumberReplacer", "return 2 * number", 7)
_TEXT = """\
def double(number: int) -> int:
    return 2 * number

def count(number: int) -> int:
    at = 0
    while at < number:
        at += 1
    return at
"""
_CHECK = {"check": ("-c", "import qlinkgen.plan as plan; assert (plan.double(3), plan.count(3)) == (6, 3)")}


def _places(text: str) -> list[Candidate]:
    """Places in the lines of a module as if each had one operator; its name is what the line becomes."""
    lines = [line.strip() for line in text.splitlines() if line.startswith(" ")]
    return [Candidate(_MODULE, "", f"{line} + 1", line, 0) for line in lines if "while" not in line]


def _change(text: str, place: Candidate) -> str:
    return text.replace(place.line, place.operator)


def _tree(folder: Path, text: str = _TEXT) -> Path:
    module = folder / _MODULE
    module.parent.mkdir(parents=True)
    module.write_text(text)
    (module.parents[1] / "__init__.py").touch()
    return folder


def test_the_draw_depends_on_the_seed_and_on_the_lines_drawn(tmp_path: Path) -> None:
    tree, places = _tree(tmp_path / "old"), _places(_TEXT)
    drawn = drawing.draw(tree, places, 3, seed=1, change=_change)
    assert len(drawn) == 3
    assert drawing.draw(tree, reversed(places), 3, seed=1, change=_change) == drawn
    lines = {seed: {each.was for each in drawing.draw(tree, places, 1, seed, _change)} for seed in range(20)}
    assert len(set.union(*lines.values())) == 4
    edited = _TEXT.replace("2 * number", "number + number")
    moved = drawing.draw(_tree(tmp_path / "new", edited), _places(edited), 4, seed=1, change=_change)
    assert {each.was for each in moved} - {"return number + number"} == {
        each.was for each in drawing.draw(tree, places, 4, 1, _change)
    } - {"return 2 * number"}
    ranks = {each.rank(1) for each in places}
    assert {replace(each, occurrence=9).rank(1) for each in places} == ranks


@pytest.mark.parametrize(
    ("before", "after", "noise"),
    [
        ("def f(a: int | None) -> int: return a", "def f(a: int + None) -> int: return a", True),
        ("def f(a) -> A | B: return a", "def f(a) -> A & B: return a", True),
        ("a: int | str = 1", "a: int ^ str = 1", True),
        ("Part = One | Two | list[int]", "Part = One | Two - list[int]", True),
        ("x = isinstance(a, One | None)", "x = isinstance(a, One * None)", True),
        ("def f(*, a): pass", "def f(-, a): pass", True),
        ('def f():\n    """1"""\n    return 1', 'def f():\n    """2"""\n    return 1', True),
        ("a = 1", "a =  1", True),
        ("@dataclass(frozen=True)\nclass A: pass", "@dataclass(frozen=False)\nclass A: pass", True),
        ("@dataclass(eq=True)\nclass A: pass", "@dataclass(eq=False)\nclass A: pass", False),
        ("a = b | c", "a = b & c", False),
        ("a = MARK | 1", "a = MARK & 1", False),
        ("a = 1", "a = 2", False),
        ("a: int = 1", "a: int = 2", False),
        ("if a: pass", "if not a: pass", False),
    ],
)
def test_what_only_readers_and_type_checkers_see_is_not_drawn(before: str, after: str, noise: bool) -> None:
    assert is_noise(before, after) == noise


def test_identity_is_not_traded_for_equality() -> None:
    wanted = ["Eq_NotEq", "Is_IsNot", "IsNot_Is", "Lt_LtE"]
    assert [each for each in wanted if drawing.is_wanted(f"ReplaceComparisonOperator_{each}")] == wanted
    assert not any(
        drawing.is_wanted(f"ReplaceComparisonOperator_{each}") for each in ("Eq_Is", "IsNot_NotEq")
    )


def test_a_mutant_shows_all_its_lines() -> None:
    mutant = mutant_of(_PLACE, "a = 1\nb = [\n    2,\n]\nc = 3\n", "a = 1\nb = []\nc = 3\n")
    assert (mutant.line, mutant.was, mutant.now) == (2, "b = [ 2, ]", "b = []")


def test_a_change_that_a_test_sees_is_killed_and_others_survive(tmp_path: Path) -> None:
    tree = _tree(tmp_path)
    stages = killing.fit(tree, _CHECK)
    same_value = _TEXT.replace("2 * number", "number * 2")
    wrong_value = _TEXT.replace("2 * number", "3 * number")
    for text, killer in ((_TEXT, None), (same_value, None), (wrong_value, "check")):
        result = killing.judged(tree, stages, mutant_of(_PLACE, f"{_TEXT}\n", text))
        assert (result.stage, result.late) == (killer, False)
        assert (tree / _MODULE).read_text() == _TEXT


def test_an_endless_loop_is_killed(tmp_path: Path) -> None:
    tree = _tree(tmp_path)
    endless = mutant_of(_PLACE, _TEXT, _TEXT.replace("at += 1", "at += 0"))
    stages = [replace(each, limit=1.0) for each in killing.fit(tree, _CHECK)]
    result = killing.judged(tree, stages, endless)
    assert (result.stage, result.late) == ("check", True)


def test_stages_that_judge_nothing_are_refused(tmp_path: Path) -> None:
    tree = _tree(tmp_path)
    with pytest.raises(killing.NotFit, match="fails without a mutant"):
        killing.fit(tree, {"red": ("-c", "raise SystemExit(1)")})
    with pytest.raises(killing.NotFit, match="does not import"):
        killing.fit(tree, {"green": ("-c", "pass")})


def test_no_mutant_hides_behind_bytecode(tmp_path: Path) -> None:
    tree = _tree(tmp_path / "tree")
    subprocess.run(["git", "init", "-q"], cwd=tree, check=True)
    copy = killing.copied(tree, tmp_path / "copy")
    before = (copy / _MODULE).stat()
    killing.check(copy, [killing.Stage("check", _CHECK["check"], limit=60)])
    (copy / _MODULE).write_text(_TEXT.replace("2 * number", "3 * number"))
    os.utime(copy / _MODULE, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert (copy / _MODULE).stat().st_size == before.st_size
    with pytest.raises(killing.NotFit):
        killing.check(copy, [killing.Stage("check", _CHECK["check"], limit=60)])


def test_a_page_names_every_survivor_with_its_reason() -> None:
    places = [Candidate("m.py", "", "core/NumberReplacer", "a = 1", 4, number) for number in range(3)]
    mutants = [mutant_of(place, "a = 1\n", f"a = {5 * place.number}\n") for place in places]
    results = {each.id: killing.Result(each.id, None, late=False, seconds=30.0) for each in places}
    results[places[2].id] = killing.Result(places[2].id, "plan", late=True, seconds=60.0)
    run = page.Run("python -m tests.mutants", 1, 99, 3, mutants, results)
    text = page.text(run, [page.Reason("the same", module="m.py", was="a = 1", now="a = 0")])
    assert "3 mutants" in text
    assert "stopped" not in text
    assert "stopped before it tried 2 more" in page.text(replace(run, drawn=5), [])
    assert "1 are killed, 33.3 %" in text
    assert "| `m.py:1` | `` a = 1 `` | `` a = 0 `` | the same |\n" in text
    assert f"| `m.py:1` | `` a = 1 `` | `` a = 5 `` | {page.UNEXPLAINED} |\n" in text
    assert "a = 10" not in text


def test_a_run_goes_on_where_nothing_can_have_changed(tmp_path: Path) -> None:
    places = [Candidate("m.py", "", "core/NumberReplacer", "a = 1", 4, number) for number in range(4)]
    mutants = [mutant_of(place, "a = 1\n", f"a = {5 + place.number}\n") for place in places]
    stages = ("plan", None, None)
    results = [
        killing.Result(place.id, stage, late=False, seconds=1.0)
        for place, stage in zip(places, stages, strict=False)
    ]
    path = tmp_path / "results.jsonl"
    assert settled(path, mutants, []) == {}
    path.write_text("".join(f"{json.dumps(asdict(each))}\n" for each in results))
    explained = settled(path, mutants, [page.Reason("the same", now="a = 6")])
    assert explained == {each.id: each for each in results[:2]}


def test_every_reason_is_of_code_that_there_is() -> None:
    for each in page.reasons():
        assert each.why.strip()
        names = [each.module] if each.module else [str(path) for path in (ROOT / "qlinkgen").rglob("*.py")]
        if each.was:
            texts = [" ".join((ROOT / name).read_text("utf-8").split()) for name in names]
            assert any(each.was in text for text in texts), f"{each.was} is gone: remove its reason"
