"""Stack depth: frames by the compiler, calls from the disassembly of the linked program.

`-fstack-usage` gives the frame of each function, and the disassembly the calls; the depth is the sum along
the worst path. AVR's compiler is too old to write a call graph, so both targets are read in this way. An
assembler function from the compiler's library has no line of `-fstack-usage`: its pushes are counted.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.firmware_build import Target, run

_HEAD = re.compile(r"^(?P<start>[0-9a-f]+) <(?P<name>[^>]+)>:$", re.MULTILINE)
_LINE = re.compile(r"^\s*[0-9a-f]+:\t(?P<mnemonic>\S+)(?:\t(?P<operands>.*))?$")
# Only the address: the name next to it may be that of a constant with the same value.
_PLACE = re.compile(r"\b(?:0x)?(?P<address>[0-9a-f]+) <[^>]+>\s*$")
_USAGE = re.compile(r"^.*:(?P<name>[^:\t]+)\t(?P<size>\d+)\t(?P<kind>.+)$")
_CALLS = {"call", "rcall", "bl"}
_INDIRECT = {"icall", "eicall", "blx"}
_ENDS = {"ret", "reti", "jmp", "rjmp", "ijmp", "b", "b.n", "b.w", "bx", "udf"}
_POPS_PC = re.compile(r"pop\s.*\bpc\b")
# A jump to a function through a register, instead of a call; also the jump tables of a switch on AVR.
_TAIL_BY_REGISTER = {"ijmp", "bx"}
_SWITCH = "__tablejump2__"


class UnknownDepth(Exception):
    """A stack without a computable bound: recursion, a variable frame size, a call to an unknown function."""


@dataclass
class Function:
    """Stack frame of one function of a program, and its calls and jumps."""

    name: str
    frame: int = 0  # bytes without the return address
    calls: set[str] = field(default_factory=set)
    jumps: set[str] = field(default_factory=set)  # targets of its jumps
    indirect: bool = False
    compiled: bool = False  # listed by -fstack-usage
    falls_into: str = ""  # assembler may continue into the next symbol; compiled code never does


class CallGraph:
    """The functions of one linked program."""

    def __init__(
        self,
        target: Target,
        program: Path,
        pointed_to: Collection[str] | None = None,
        stacks: Path | None = None,
    ) -> None:
        """Read a program and the `.su` files beside it, or in another folder.

        `pointed_to` are all possible targets of pointers; without it a call through one raises UnknownDepth.
        """
        self._target = target
        self.pointed_to = pointed_to
        listing = run(target.tool("objdump"), "-d", "--no-show-raw-insn", program)
        self.functions = _functions(listing)
        self.measured = usages(stacks or program.parent)
        for name, function in self.functions.items():
            # A copy made for constant arguments has its own name here, such as wrap.constprop.0; the compiler
            # calls it wrap or wrap.constprop.
            names = (name, name.rpartition(".")[0], name.partition(".")[0])
            usage = next((self.measured[each] for each in names if each in self.measured), None)
            if usage is not None:
                function.frame, function.compiled = usage - target.call, True
            elif function.falls_into:
                function.jumps.add(function.falls_into)

    def depth(self, root: str) -> int:
        """Bytes on the stack at the deepest point of a function, its own return address included."""
        return self._target.call + self._below(root, (), ())

    def _below(self, name: str, path: tuple[str, ...], jumped: tuple[str, ...]) -> int:
        if name in path:
            raise UnknownDepth(f"recursion: {' -> '.join((*path, name))}")
        function = self.functions.get(name)
        if function is None:
            raise UnknownDepth(f"{' -> '.join((*path, name))} is not in the program")
        calls = function.calls | (self._through_pointers(function) if function.indirect else set())
        called = [self._target.call + self._below(each, (*path, *jumped, name), ()) for each in calls]
        # Compiled code has released its frame when it jumps to another function; assembler may not have. A
        # cycle of jumps is an assembler loop with labels in it, not a recursion.
        gone = [
            self._below(each, path, (*jumped, name)) for each in function.jumps - {name} - frozenset(jumped)
        ]
        kept = 0 if function.compiled else function.frame
        return max(
            [function.frame, *(function.frame + depth for depth in called), *(kept + depth for depth in gone)]
        )

    def _through_pointers(self, function: Function) -> set[str]:
        if self.pointed_to is None:
            raise UnknownDepth(f"{function.name} calls through a pointer to an unknown function")
        return set(self.pointed_to)

    def callers(self) -> Mapping[str, set[str]]:
        """The callers of each function, by call or by jump."""
        found: dict[str, set[str]] = {name: set() for name in self.functions}
        for function in self.functions.values():
            for each in function.calls | function.jumps:
                found.setdefault(each, set()).add(function.name)
        return found


def usages(folder: Path) -> dict[str, int]:
    """The output of `-fstack-usage` in a folder, return address included if the chip pushes it."""
    found: dict[str, int] = {}
    for line in _lines(folder):
        if (match := _USAGE.match(line)) is None:
            continue
        if match["kind"] not in {"static", "dynamic,bounded"}:
            raise UnknownDepth(f"{match['name']} has a stack frame of variable size: {match['kind']}")
        found[match["name"]] = max(int(match["size"]), found.get(match["name"], 0))
    return found


def _lines(folder: Path) -> Iterator[str]:
    for file in sorted(folder.rglob("*.su")):
        yield from file.read_text().splitlines()


def _functions(listing: str) -> dict[str, Function]:
    heads = list(_HEAD.finditer(listing))
    starts = [int(head["start"], 16) for head in heads]
    names = [head["name"] for head in heads]
    found = {name: Function(name) for name in names}
    for index, head in enumerate(heads):
        end = heads[index + 1].start() if index + 1 < len(heads) else len(listing)
        function, open_end = found[head["name"]], False
        for line in listing[head.end() : end].splitlines():
            if (match := _LINE.match(line)) and not match["mnemonic"].startswith("."):
                place = _PLACE.search(match["operands"] or "")
                at = int(place["address"], 16) if place else -1
                to = names[bisect_right(starts, at) - 1] if place else ""
                # A target inside the function is not a call, even with a call instruction: ARM uses it for
                # far jumps, AVR to allocate stack, which the compiler has counted.
                inside = to == function.name and at != int(head["start"], 16)
                open_end = _take(function, match["mnemonic"], match["operands"] or "", "" if inside else to)
        if open_end and index + 1 < len(heads):
            function.falls_into = names[index + 1]
    return found


def _take(function: Function, mnemonic: str, operands: str, to: str) -> bool:
    """Record an instruction with the target `to`; returns whether execution can continue after it."""
    if mnemonic in _CALLS and to:
        function.calls.add(to)
    elif mnemonic in _INDIRECT:
        function.indirect = True
    elif mnemonic in _TAIL_BY_REGISTER:
        function.indirect |= operands.split()[:1] != ["lr"] and function.name != _SWITCH
    elif to and to != function.name and mnemonic[0] in "bjr":
        function.jumps.add(to)
    elif mnemonic == "push":
        function.frame += _pushed(operands)
    elif mnemonic == "sub" and operands.startswith("sp, #"):
        function.frame += int(operands.partition("#")[2].split()[0], 0)
    return mnemonic not in _ENDS and not _POPS_PC.match(f"{mnemonic} {operands}")


def _pushed(operands: str) -> int:
    """Bytes of a push: one register on AVR, a list of words on ARM."""
    return 4 * len(operands.strip("{}").split(",")) if operands.startswith("{") else 1
