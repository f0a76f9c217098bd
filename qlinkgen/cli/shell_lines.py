"""The lines of ``qlinkgen shell``: what they mean, and how they are completed."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from types import ModuleType

import click
from click.shell_completion import CompletionItem

from qlinkgen.cli import jsonlines
from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.codec import fields
from qlinkgen.cli.common import addressed, did_you_mean, find_message
from qlinkgen.cli.completion import assignment_items, message_items
from qlinkgen.cli.encode import compose
from qlinkgen.cli.hosting import selected_packet
from qlinkgen.cli.repeating import answers_of
from qlinkgen.cli.send_bus import check_request
from qlinkgen.errors import LinkError
from qlinkgen.link.codec import Framed, Message, address_of
from qlinkgen.link.host_rules import HostRules
from qlinkgen.link.transaction import Packet
from qlinkgen.model.message import Message as Described
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.texts import one_line, visible
from qlinkgen.model.values import Json, whole_number
from qlinkgen.transport.blocking import BlockingMaster

#: The words of the shell itself, with their help.
WORDS: Mapping[str, str] = {
    ".node": "NODE: the node of requests without one of their own (@NODE)",
    ".list": "list the messages that can be sent",
    ".fields": "MESSAGE: list its fields with their units",
    ".help": "list these words",
    ".quit": "leave the shell; so does Ctrl-D",
}


class Lines:
    """Performs lines on a bus: a message with values, sent as by `qlinkgen send`, or a word of the shell.

    Attributes:
        node: address of requests that state none, None before one is chosen.
        ended: the shell was left.
    """

    def __init__(
        self,
        protocol: Protocol,
        codec: ModuleType,
        master: BlockingMaster,
        node: int | None,
        rules: HostRules | None = None,
    ) -> None:
        """Take the master; ``rules`` are those of a host, where nodes are the numbers that it selects."""
        self._rules = rules
        self._protocol, self._codec, self._master = protocol, codec, master
        self.node = node
        self.ended = False

    @property
    def prompt(self) -> str:
        """The name of the protocol, with the node if there is one."""
        node = "" if self.node is None else f" {self.node}"
        return f"{self._protocol.name}{node}> "

    def perform(self, line: str) -> bool:
        """Perform a line and print the outcome; return whether it succeeded."""
        try:
            words = shlex.split(line, comments=True)
            if words and words[0].startswith("."):
                self._own(words)
            elif words:
                self._send(words)
        except (Failure, LinkError) as error:
            text = error.text if isinstance(error, Failure) else str(error)
        except ValueError as error:  # of shlex: a quotation mark without its partner
            text = f"{error}; write \\ before a quotation mark that is meant"
        else:
            return True
        click.echo(visible(f"error: {text}"), err=True)
        return False

    def _own(self, words: list[str]) -> None:
        word, *rest = words
        match word:
            case ".node" if len(rest) == 1:
                self.node = self._number(rest[0])
            case ".fields" if len(rest) == 1:
                for each in self._described(find_message(self._protocol, rest[0])):
                    click.echo(each)
            case ".list" if not rest:
                for sent in self._sendable():
                    named = sent.name.removesuffix(".request")
                    click.echo(visible(f"{named:32} {one_line(self._doc(sent))}".rstrip()))
            case ".help" if not rest:
                click.echo("MESSAGE [@NODE] [FIELD=VALUE]...   send a message, and print the response")
                click.echo("\n".join(f"{own:8} {text}" for own, text in WORDS.items()))
            case ".quit" if not rest:
                self.ended = True
            case _:
                hint = did_you_mean(word, WORDS) if word not in WORDS else WORDS[word]
                raise Failure(f"'{' '.join(words)}' is not a line of the shell; {hint or '.help lists them'}")

    def _number(self, text: str) -> int:
        number = whole_number(text)
        if self._rules and self._rules.selects:
            if number is None or number not in self._rules.selects:
                known = ", ".join(map(str, self._rules.selects))
                raise Failure(
                    f".node {text}: {self._protocol.name} selects {known} as {self._rules.selected}"
                )
            return number
        nodes = self._protocol.bus.nodes
        first, last = nodes or (0, 0)
        whole = number is not None and (first <= number <= last or number == self._protocol.bus.broadcast)
        if nodes is None or not whole:
            known = "has no nodes" if nodes is None else f"has nodes {first}..{last}"
            raise Failure(f".node {text}: {self._protocol.name} {known}")
        assert number is not None
        return number

    def _sendable(self) -> Iterator[Described]:
        for message in self._protocol.messages:
            command = self._protocol.command_of(message)
            if command is None or message is command.request:
                yield message

    def _doc(self, message: Described) -> str:
        command = self._protocol.command_of(message)
        return message.doc or (command.doc if command else "")

    def _described(self, message: Described) -> Iterator[str]:
        for value in (*self._protocol.beside(message), *message.values):
            unit = f" [{value.unit}]" if value.unit else ""
            yield visible(f"{value.name + unit:32} {one_line(value.doc)}".rstrip())

    def _send(self, words: list[str]) -> None:
        """Send a message and print the answers, or that there is none."""
        name, *rest = words
        message = find_message(self._protocol, name)
        check_request(self._protocol, message)
        command = self._protocol.command_of(message)
        if command is None or command.steps or command.stopped:
            raise Failure(f"{name} is not a request with its response; use `qlinkgen send`")
        nodes = [word[1:] for word in rest if word.startswith("@")]
        if not nodes and self.node is not None and addressed(self._protocol, message):
            nodes = [str(self.node)]
        values = tuple(self._without_unit(message, word) for word in rest if not word.startswith("@"))
        addresses = () if self._rules else tuple(nodes)
        request: Framed = compose(self._protocol, name, values, addresses, None, codec=self._codec)[2]
        try:
            request.to_frame()
        except self._codec.EncodeError as error:
            raise Failure(str(error)) from None
        reply = self._master.transact(self._packet(self._rules, request, nodes) if self._rules else request)
        answers = answers_of(reply.response)
        for answer in answers:
            click.echo(visible(self._told(answer)))
        click.echo(f"  {'answered after' if answers else 'sent;'} {reply.elapsed * 1000:.2f} ms")

    def _packet(self, rules: HostRules, request: Framed, given: list[str]) -> Packet:
        """Return a request for what a host selects: the number that is given, else the one chosen before."""
        if len(given) > 1:
            raise Failure(f"@{' @'.join(given)}: one number is selected at a time")
        if given:
            number = whole_number(given[0])
            if number is None:
                raise Failure(f"@{given[0]}: not a whole number")
            return selected_packet(self._protocol, rules, request, number, given=f"@{number}")
        selection = self._protocol.bus.selection
        command = self._protocol.command_of(self._protocol.by_name[request.NAME])
        depends = selection is not None and command is not None and selection.decides(command)
        return rules.packet(request, self.node if depends else None)

    def _without_unit(self, message: Described, word: str) -> str:
        """Remove the unit of a field after each of its numbers."""
        name, mark, text = word.partition("=")
        unit = next((value.unit for value in message.values if value.name == name), "")
        if not unit or not mark:
            return word
        return f"{name}={','.join(each.strip().removesuffix(unit).rstrip() for each in text.split(','))}"

    def _told(self, answer: Message) -> str:
        message = self._protocol.by_name[answer.NAME]
        units = {value.name: f" {value.unit}" if value.unit else "" for value in message.values}
        node = address_of(answer)
        head = answer.NAME if node is None else f"{answer.NAME} {answer.ADDRESS} {node}"
        values = fields(message, answer).items()
        return "\n".join(
            (head, *(f"  {name} = {_shown(value)}{units.get(name, '')}" for name, value in values))
        )

    def complete(self, text: str) -> tuple[str, list[CompletionItem]]:
        """Return the last word of a line, and its completions."""
        words = text.split()
        last = "" if not text or text[-1].isspace() else words.pop()
        if not words:
            own = [CompletionItem(name, help=doc) for name, doc in WORDS.items() if name.startswith(last)]
            sent = {each.name.removesuffix(".request"): each for each in self._sendable()}
            named = [each for each in message_items(self._protocol, last) if each.value in sent]
            return last, own if last.startswith(".") else named
        if words == [".fields"]:
            return last, message_items(self._protocol, last)
        with suppress(KeyError):
            message = self._protocol.message(words[0])
            given = [word for word in words[1:] if not word.startswith("@")]
            return last, assignment_items(self._protocol, message, given, last)
        return last, []


def _shown(value: Json) -> str:
    return value if isinstance(value, str) else jsonlines.line(value)


#: Returns the next line for a prompt. Raises EOFError at the end.
Reader = Callable[[str], str]


def perform_all(lines: Lines, read: Reader) -> bool:
    """Read and perform lines until the end; return whether all succeeded."""
    fine = True
    while not lines.ended:
        try:
            line = read(lines.prompt)
        except EOFError:
            break
        fine = lines.perform(line) and fine
    return fine
