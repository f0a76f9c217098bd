"""Second pass, the sides of a link: which of them asks, and whether one receiver tells what it hears."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

from qlinkgen.model.frame import DelimitedFrame, Frame
from qlinkgen.model.message import Message
from qlinkgen.model.transaction import Asker, Command
from qlinkgen.schema.file_model import SchemaFile
from qlinkgen.schema.notation import shown
from qlinkgen.schema.report import Reporter, did_you_mean, listed
from qlinkgen.schema.source import Path

_RULE = "bad-link"
#: What a command says that both sides ask.
EITHER = "either"


def check_side(file: SchemaFile, name: str, side: str, place: Path, report: Reporter) -> None:
    """Check the side that sends a message."""
    sides, needs = file.bus.sides or [], (place, ("bus",))
    if not sides:
        what, hint = (
            f"{name} is from a side, but the bus has none",
            "write bus: {kind: link, sides: [host, device]}",
        )
        report.error(_RULE, place, what, hint, of_key=True, needs=needs)
    elif side not in sides:
        what, hint = f"the bus has no side {shown(side)}", f"its sides are {listed(sides)}"
        report.error(_RULE, place, what, did_you_mean(side, sides, hint), needs=needs)


def asker_of(file: SchemaFile, name: str, report: Reporter) -> Asker:
    """The side that sends the request of a command, which the defaults may state."""
    own = file.commands[name].side
    side, place = (own, ("commands", name, "from")) if own else (file.defaults.side, ("defaults", "from"))
    if side is None:
        return "first"
    if file.bus.kind != "link":
        what, hint = f"only one side of a {file.bus.kind} bus asks", "use kind: link, or remove it"
        report.error(_RULE, place, what, hint, of_key=True, needs=(place, ("bus",)))
        return "first"
    if side == EITHER:
        return "either"
    check_side(file, name, side, place, report)
    return "second" if side in (file.bus.sides or ())[1:] else "first"


def check_sides(
    file: SchemaFile,
    frame: Frame | None,
    commands: Sequence[Command],
    messages: Sequence[Message],
    *,
    places: Mapping[str, Path],
    report: Reporter,
) -> None:
    """Check that a side which both asks and answers can tell requests from answers.

    Two receivers share the bytes. Each has to pass over the frames of the other one as a whole, for which it
    needs their end and their check value.
    """
    asked = next((command for command in commands if command.asker != "first"), None)
    if asked is None or frame is None:
        return
    place: Path = ("commands", asked.name)
    if why := _obstacle(file, frame, messages):
        what, hint = f"both sides cannot ask: {why}", "remove from, and write a schema for each side"
        report.error(_RULE, place, what, hint, of_key=True, needs=(place, ("frame",), ("bus",)))
        return
    _check_names(file, report)
    requests = {each.id: each for each in messages if each.direction == "request"}
    for answer in messages:
        request = requests.get(answer.id) if answer.direction == "response" else None
        if request is not None:
            path = places[answer.name]
            what = f"{answer.name} has the id of {request.name}, {answer.id:#04x}, and both sides ask"
            hint = "give the answers other ids, or let a part with role: direction tell them"
            report.error(_RULE, path, what, hint, of_key=True, needs=(path, ("frame",), ("bus",)))
            return


def _check_names(file: SchemaFile, report: Reporter) -> None:
    """Check that nothing is called like a class of one side."""
    ends = ("calls", "node_calls", "handlers")
    taken = {f"{side}_{end}" for side in file.bus.sides or () for end in ends}
    refuse_classes(file, taken, "that side", report)


def refuse_classes(file: SchemaFile, taken: Collection[str], whose: str, report: Reporter) -> None:
    """Refuse messages and types that are called like a class of a bus module, blocking or for asyncio."""
    groups: dict[str, Iterable[str]] = {
        "messages": file.messages,
        "enums": file.enums,
        "flags": file.flags,
        "types": file.types,
    }
    for group, name in ((group, name) for group, names in groups.items() for name in names):
        if name.removeprefix("async_") in taken:
            what = f"{name} is what generated Python calls a class of {whose}"
            report.error("name-clash", (group, name), what, "rename it", of_key=True)


def _obstacle(file: SchemaFile, frame: Frame, messages: Sequence[Message]) -> str:
    """Why a receiver of one direction cannot pass over frames of the other, "" if it can."""
    if not isinstance(frame, DelimitedFrame):
        return "there are several kinds of frame"
    if not frame.part("length") and not frame.part("terminator"):
        return "a frame has neither a length nor a terminator"
    if not frame.part("checksum"):
        return "a frame has no check value"
    if any(each.seeds for each in messages):
        return "a check value depends on the message"
    if file.to_unknown:
        return "an answer is like any unknown request, to which a reply is stated"
    if not frame.alike:
        return "a part is only in the frames of one direction"
    return ""
