"""Mutants of a tree: which there are, which of them are noise, and a sample of the others."""

from __future__ import annotations

import ast
import builtins
import difflib
import hashlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

#: Arguments of `dataclass` that only forbid: to write, to add attributes, to give arguments by place.
_FORBID = frozenset({"frozen", "slots", "kw_only"})


@dataclass(frozen=True)
class Candidate:
    """A place where an operator of cosmic-ray changes a module."""

    module: str
    definition: str
    operator: str
    line: str
    column: int
    #: Counts candidates that are otherwise equal: equal lines of a function, both steps of a number.
    number: int = 0
    #: The number of this change among those of its operator in the module, as cosmic-ray counts them.
    occurrence: int = 0

    @property
    def id(self) -> str:
        """Identifies the place as long as its line and its function are there, whatever else is edited."""
        return _digest(self.module, self.definition, self.operator, self.line, self.column, self.number)

    def rank(self, seed: int) -> str:
        """A pseudo-random rank."""
        return _digest(seed, self.id)


def _digest(*parts: object) -> str:
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Mutant:
    """A changed module: its changed lines before and after, and its whole text after."""

    place: Candidate
    line: int
    was: str
    now: str
    text: str

    @property
    def module(self) -> str:
        """Path of the module."""
        return self.place.module


def candidates(root: Path, modules: Iterable[str]) -> Iterator[Candidate]:
    """Everything that cosmic-ray would change in modules of a tree."""
    from cosmic_ray import plugins
    from cosmic_ray.ast import ast_nodes, get_ast

    wanted = [name for name in plugins.operator_names() if is_wanted(name.removeprefix("core/"))]
    for module in modules:
        text = (root / module).read_text("utf-8")
        lines, definitions = text.splitlines(), _definitions(text)
        nodes = list(ast_nodes(get_ast(text)))
        seen: Counter[Candidate] = Counter()
        for name in wanted:
            operator = plugins.get_operator(name)
            if operator.arguments():
                continue
            positions = (start for node in nodes for start, _ in operator().mutation_positions(node))
            for occurrence, (number, column) in enumerate(positions):
                line = lines[number - 1]
                indent = len(line) - len(line.lstrip())
                place = Candidate(module, definitions[number], name, line.strip(), column - indent)
                yield replace(place, number=seen[place], occurrence=occurrence)
                seen[place] += 1


def is_wanted(operator: str) -> bool:
    """Whether an operator is drawn from: not one that trades identity for equality, or the reverse."""
    kind, *names = operator.split("_")
    return kind != "ReplaceComparisonOperator" or len(set(names) & {"Is", "IsNot"}) != 1


def _definitions(text: str) -> dict[int, str]:
    """The function or class that each line belongs to, with what encloses it."""
    found = dict.fromkeys(range(1, len(text.splitlines()) + 2), "")

    def visit(node: ast.AST, name: str) -> None:
        for each in ast.iter_child_nodes(node):
            inner = name
            if isinstance(each, ast.FunctionDef | ast.ClassDef):
                inner = f"{name}.{each.name}".removeprefix(".")
                first = min([each.lineno, *(decorator.lineno for decorator in each.decorator_list)])
                found.update(dict.fromkeys(range(first, (each.end_lineno or first) + 1), inner))
            visit(each, inner)

    visit(ast.parse(text), "")
    return found


def mutated(text: str, place: Candidate) -> str:
    """The text of a module after the change of a place."""
    from cosmic_ray import plugins
    from cosmic_ray.mutating import mutate_code

    return str(mutate_code(text, plugins.get_operator(place.operator)(), place.occurrence))


def draw(
    root: Path,
    places: Iterable[Candidate],
    number: int,
    seed: int,
    change: Callable[[str, Candidate], str] = mutated,
) -> list[Mutant]:
    """A sample of mutants that are not noise, in the order of their modules and lines."""
    drawn: list[Mutant] = []
    for place in sorted(places, key=lambda each: each.rank(seed)):
        if len(drawn) == number:
            break
        before = (root / place.module).read_text("utf-8")
        after = change(before, place)
        if not is_noise(before, after):
            drawn.append(mutant_of(place, before, after))
    return sorted(drawn, key=lambda each: (each.module, each.line, each.place.id))


def mutant_of(place: Candidate, before: str, after: str) -> Mutant:
    """A mutant by the text of its module before and after."""
    old, new = before.splitlines(), after.splitlines()
    matcher = difflib.SequenceMatcher(None, old, new, autojunk=False)
    changes = [each for each in matcher.get_opcodes() if each[0] != "equal"]
    (_, i, _, k, _), (_, _, j, _, m) = changes[0], changes[-1]
    return Mutant(place, i + 1, _joined(old[i:j]), _joined(new[k:m]), after)


def _joined(lines: Iterable[str]) -> str:
    return " ".join(" ".join(lines).split())


def is_noise(before: str, after: str) -> bool:
    """Whether a mutant is not Python, or differs only in what type checkers and readers look at."""
    try:
        return _essence(after) == _essence(before)
    except SyntaxError:
        return True


@lru_cache(maxsize=64)
def _essence(text: str) -> str:
    return ast.dump(_Essence().visit(ast.parse(text)))


class _Essence(ast.NodeTransformer):
    """Removes annotations, docstrings and what dataclasses forbid, and makes all unions of types equal."""

    def visit(self, node: ast.AST) -> ast.AST:
        match node:
            case ast.arg() | ast.AnnAssign():
                node.annotation = ast.Constant(None)
            case ast.FunctionDef():
                node.returns = None
            case ast.Call(func=ast.Name(id="dataclass")):
                node.keywords = [each for each in node.keywords if each.arg not in _FORBID]
            case ast.Expr(value=ast.Constant()):
                return ast.Pass()
            case ast.BinOp() if _is_type(node):
                return ast.Constant(None)
            case _:
                pass
        return self.generic_visit(node)


def _is_type(node: ast.expr) -> bool:
    match node:
        case ast.BinOp(left=left, right=right):
            return _is_type(left) and _is_type(right)
        case ast.Subscript(value=value):
            return _is_type(value)
        case ast.Name(id=name):
            is_class = name[0].isupper() and not name.isupper()
            return is_class or isinstance(getattr(builtins, name, None), type)
        case ast.Constant(value=None):
            return True
        case _:
            return False
