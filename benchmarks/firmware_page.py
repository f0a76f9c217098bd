"""The tables of docs/firmware.md, each between `<!-- table: NAME -->` and `<!-- end -->`."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import yaml

from benchmarks.firmware_answers import BAUD, PHASES, Reply
from benchmarks.firmware_budget import ALLOWANCES, LIMITS, STACK_ALLOWANCES, broken, goals
from benchmarks.firmware_build import AVR, CORTEX_M0, ROOT, TARGETS, Target, clock
from benchmarks.firmware_cycles import Frame
from benchmarks.firmware_measure import Measured
from benchmarks.firmware_peers import Footprint
from benchmarks.firmware_size import ANSWER, PAYLOAD, Core, Costs
from benchmarks.firmware_slave import PORTS
from benchmarks.report import Goal, as_markdown, number
from qlinkgen.codecs import qlink

PAGE = ROOT / "docs" / "firmware.md"
DEVIATIONS = ROOT / "tests" / "c" / "deviations.yaml"
_TABLE = re.compile(
    r"(?P<head><!-- table: (?P<name>\w+) -->\n).*?(?P<end>^<!-- end -->$)", re.DOTALL | re.MULTILINE
)

OWN = "this header"
FORMS = {"FOLD": "folded", "LOOP": "bitwise", "NIBBLE": "table of 16", "TABLE": "table of 256"}
_CORES = {
    **{form: f"one message, CRC {title}" for form, title in FORMS.items()},
    ANSWER: "no message: an empty answer, CRC folded",
    PAYLOAD: "no message: any payload, CRC folded",
}
_BUFFERS = {
    "receiver": "`{0}_receiver_t`",
    "wire": "`uint8_t wire[{1}_MAX_WIRE_SIZE]`",
    "table": "dispatch table",
}


def tables(measured: Measured) -> dict[str, str]:
    """The tables of this project's own figures, by name."""
    return {
        "tools": f"Compilers: {measured.tools}.",
        "budget": _budget(measured),
        "allowances": _allowances(),
        "core": _core(measured),
        "ram": _ram(measured),
        "choice": _choice(measured),
        "floor": _floor(measured),
        "cycles": _cycles(measured),
        "answers": _answers(measured),
        "time": _time(measured),
        "slave": _slave(measured),
        "replies": _replies(measured),
        "deviations": deviations(),
        **{name: _messages(measured, name) for name in measured.messages[AVR.name]},
    }


def _budget(measured: Measured) -> str:
    rows = [
        [goal.what, f"{goal.measured:.0f} {goal.unit}", f"{goal.limit:.0f} {goal.unit}", _verdict(goal)]
        for goal in goals(measured)
    ]
    return as_markdown(["", "measured", "budget", ""], rows)


def _allowances() -> str:
    rows = []
    for (protocol, message), each in ALLOWANCES.items():
        flash = " / ".join(str(each.flash[target.name]) for target in TARGETS)
        rows.append(f"- {protocol}, {message}, {flash} bytes: {each.reason}")
    chips = " / ".join(target.title for target in TARGETS)
    titles = {target.name: target.title for target in TARGETS}
    rows += [
        f"- qlink, {titles[target]}, {what}: {each} bytes"
        for (target, what), each in STACK_ALLOWANCES.items()
    ]
    return "\n".join(
        [f"These are above the budget; CI limits them to their present size ({chips}):", "", *rows]
    )


def _verdict(goal: Goal) -> str:
    if goal.met:
        return "met"
    return "NOT MET" if broken(goal) else "within 10 %"


def _by_chip(*figures: str) -> list[str]:
    return [f"{target.title} {figure}" for target in TARGETS for figure in figures]


def _core(measured: Measured) -> str:
    rows = []
    for name, title in _CORES.items():
        found = [measured.core[target.name][name] for target in TARGETS]
        rows.append([title, *(str(each) for core in found for each in (core.size.flash, core.stack))])
    return as_markdown(["", *_by_chip("flash", "stack")], rows)


def _ram(measured: Measured) -> str:
    rows = []
    for protocol in measured.buffers[AVR.name]:
        for key, title in _BUFFERS.items():
            sizes = [str(measured.buffers[target.name][protocol][key]) for target in TARGETS]
            rows.append([f"{protocol}: {title.format(protocol, protocol.upper())}", *sizes])
    return as_markdown(["", *(target.title for target in TARGETS)], rows)


def _choice(measured: Measured) -> str:
    rows = []
    for name, choice in measured.dispatch[AVR.name].items():
        found = [measured.dispatch[target.name][name] for target in TARGETS]
        figures = [str(each) for dispatch in found for each in (dispatch.flash, dispatch.stack)]
        rows.append([name if name == "all" else f"`{name}`", str(choice.lines), *figures])
    return as_markdown(["", "lines", *_by_chip("flash", "stack")], rows)


def _floor(measured: Measured) -> str:
    rows = []
    for target in TARGETS:
        unit = "instructions" if target is CORTEX_M0 else "cycles"
        hand, own = (measured.floor[target.name][side] for side in ("floor", "generated"))
        for what, least, found in (
            ("flash, bytes", hand.size.flash, own.size.flash),
            ("RAM, bytes", hand.size.ram, own.size.ram),
            ("stack, bytes", hand.stack, own.stack),
            (f"encode, {unit}", hand.encode, own.encode),
            (f"receive, {unit}", hand.receive, own.receive),
            (f"longest call to receive a byte, {unit}", hand.longest, own.longest),
        ):
            rows.append([f"{target.title}: {what}", str(least), str(found), f"{found / least:.2f}"])
    return as_markdown(["", "by hand", "generated", "ratio"], rows)


def _messages(measured: Measured, protocol: str) -> str:
    costs = {target: measured.messages[target.name][protocol] for target in TARGETS}
    rows = [
        [name, *(cell for target, each in costs.items() for cell in _message(target, each, name))]
        for name in costs[AVR].framed.each
    ]
    together, mean = ["total"], ["... per message"]
    for each in costs.values():
        together += [str(each.fields.together.flash), str(each.framed.together.flash), "", ""]
        mean += [number(each.fields.mean), number(each.framed.mean), "", ""]
    return as_markdown(
        ["message", *_by_chip("get + put", "with frame", "stack", "struct")], [*rows, together, mean]
    )


def _message(target: Target, costs: Costs, name: str) -> list[str]:
    framed = costs.framed.each[name]
    behind = [str(framed.size.flash), str(framed.stack), str(costs.structs.get(name, 0))]
    if name not in costs.fields.each:
        return ["0", *behind]
    flash = costs.fields.each[name].size.flash
    return [f"**{flash}**" if flash > LIMITS[target.name].message else str(flash), *behind]


def _cycles(measured: Measured) -> str:
    rows = []
    for form, title in FORMS.items():
        cycles = measured.cycles[form]
        rows += [[f"{title}: {name}", *map(str, _frame(frame))] for name, frame in cycles.frames.items()]
    return as_markdown(["CRC: frame", "bytes", "encode", "receive", "for a byte", "longest call"], rows)


def _frame(frame: Frame) -> tuple[int, ...]:
    calls = frame.receive
    return len(calls), frame.encode, sum(calls), round(sum(calls) / len(calls)), max(calls)


def _megahertz() -> str:
    return f"{clock() / 1e6:g} MHz"


def _three_bytes() -> float:
    """Clock cycles of three byte times on the line: the limit until the answer begins."""
    return 3 * clock() * qlink.BUS.bits_per_byte / BAUD


def _time(measured: Measured) -> str:
    """The cycles compared with the time on the line, in words."""
    calls = {form: measured.cycles[form].worst_call for form in FORMS}
    byte = _three_bytes() / 3
    most = 100 * max(calls.values()) / byte
    shares = ", ".join(f"{calls[form]} cycles ({title})" for form, title in FORMS.items())
    verdict = _verdict_of_time(measured)
    return (
        f"A byte takes {byte:.0f} cycles on the line at {BAUD} baud and {_megahertz()}. The longest "
        f"call of `qlink_receive` takes {shares}: at most {most:.0f} % of that. {verdict}"
    )


def _verdict_of_time(measured: Measured) -> str:
    seen = measured.run
    asked = f"with each command sent at {PHASES} points of the clock's tick, motor at rest and moving"
    if seen.late:
        return f"The slave of the examples answers too late to {', '.join(seen.late)}, {asked}."
    reply = seen.replies[seen.slowest]
    return (
        f"The slave of the examples was never late, {asked}: its slowest answer, to {seen.slowest}, takes "
        f"{reply.us:.0f} us of {reply.allowed_us} us."
    )


def _answers(measured: Measured) -> str:
    rows = []
    for form, title in FORMS.items():
        for name, answer in measured.cycles[form].answers.items():
            total, share = answer.total, answer.total / _three_bytes()
            cells = [
                str(answer.last_byte),
                str(answer.dispatch),
                f"{1e6 * total / clock():.0f} us",
                f"{100 * share:.0f} %",
            ]
            rows.append([f"{title}: {name}", *cells])
    return as_markdown(
        ["CRC: data", "last byte", "dispatch", f"both at {_megahertz()}", "of three byte times"], rows
    )


def _slave(measured: Measured) -> str:
    rows = []
    for port, slave in measured.slaves.items():
        size = slave.size
        figures = (size.text, size.data, size.bss, slave.main, slave.interrupt)
        rows.append([f"{port} ({PORTS[port].title})", *map(str, figures)])
    return as_markdown(["", "text", "data", "bss", "stack", "stack of interrupts"], rows)


def _replies(measured: Measured) -> str:
    rows = [[name, *_reply(reply)] for name, reply in measured.run.replies.items()]
    columns = ["", "cycles, motor at rest", "cycles, moving", f"slower at {_megahertz()}", "allowed"]
    return as_markdown(columns, rows)


def _reply(reply: Reply) -> list[str]:
    moving = "not answered" if reply.moving is None else str(reply.moving)
    return [str(reply.rest), moving, f"{reply.us:.0f} us", f"{reply.allowed_us} us"]


def peers(measured: Measured, found: Mapping[str, Mapping[str, Footprint]], missing: Sequence[str]) -> str:
    """This project's core and the peers' for the same message, and the names of the missing peers."""
    rows = own_rows(measured) + [_peer(name, footprints) for name, footprints in found.items()]
    table = as_markdown(["", *_by_chip("flash", "RAM", "stack")], rows)
    return "\n\n".join([table, *(f"Not measured: {reason}." for reason in missing)])


def own_rows(measured: Measured) -> list[list[str]]:
    """The first rows of the peers' table."""
    return [
        _peer(f"{OWN}, CRC {FORMS[form]}", {each.name: measured.core[each.name][form] for each in TARGETS})
        for form in ("FOLD", "LOOP", "TABLE")
    ]


def renewed(standing: str, measured: Measured) -> str:
    """The peers' table with new rows of this project only, if the peers cannot be measured."""
    kept = [line for line in standing.splitlines()[2:] if not line.startswith(f"| {OWN}")]
    head, mark, *own = as_markdown(["", *_by_chip("flash", "RAM", "stack")], own_rows(measured)).splitlines()
    return "\n".join([head, mark, *own, *kept])


def _peer(name: str, found: Mapping[str, Footprint | Core]) -> list[str]:
    cells = [name]
    for target in TARGETS:
        each = found[target.name]
        cells += [
            str(each.size.flash),
            str(each.size.ram),
            "unbounded" if each.stack is None else str(each.stack),
        ]
    return cells


def deviations() -> str:
    """Accepted findings of the static checkers, with their reasons."""
    if not DEVIATIONS.exists():
        return "None."
    listed = yaml.safe_load(DEVIATIONS.read_text("utf-8"))
    rows = [[each["tool"], each["rule"], " ".join(each["reason"].split())] for each in listed]
    head = ["| tool | rule | reason |", "| --- | --- | --- |"]
    return "\n".join([*head, *(f"| {' | '.join(row)} |" for row in rows)])


def written(page: str) -> dict[str, str]:
    """The tables of a page, by name."""
    return {
        match["name"]: match[0].removeprefix(match["head"]).removesuffix(match["end"]).strip()
        for match in _TABLE.finditer(page)
    }


def rewritten(page: str, new: Mapping[str, str]) -> str:
    """A page with these tables; KeyError if its table names and those of `new` differ."""
    return _TABLE.sub(lambda match: f"{match['head']}\n{new[match['name']]}\n\n{match['end']}", page)
