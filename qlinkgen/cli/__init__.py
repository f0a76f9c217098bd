"""The command line. A command's module is imported when it is used, so that ``--help`` is quick."""

from __future__ import annotations

import importlib

import click

import qlinkgen
from qlinkgen.cli.boundary import debug_option, run
from qlinkgen.model.spelling import similar

#: Command to the one line of `qlinkgen --help`; the command itself is `command` in the module of its name.
COMMANDS = {
    "generate": "Write Python, C, construct and vectors for protocols, or check that they are up to date.",
    "lint": "Check schema files; every fault with its line, column, rule and fix.",
    "show": "Show a protocol or a message: layout, sizes, transactions.",
    "encode": "Values to wire bytes.",
    "decode": "Wire bytes to values: one JSON object a line.",
    "explain": "Say what every byte of a frame is, and what is wrong with it.",
    "simulate": "Put simulated nodes, a ring, or a chip set on a port of their own, with faults if wanted.",
    "scan": "Find the nodes of a Q.link bus.",
    "send": "Send one request on a port and print its answer, or one message into a ring.",
    "load": "Load an Intel HEX file into a Q.link node.",
    "monitor": "Listen to a bus or a fibre: who asks, who answers, what is repeated, late or damaged.",
    "ring": "Be a passive node of a Trio ring: send everything on, and print it.",
    "doctor": "Say what a serial port can do, what its latency costs, and what to change.",
}


class LazyGroup(click.Group):
    """A group that lists its commands without importing them."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002  # click's interface
        """Names, in the order of a user's work."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        """Import a command when it is used."""
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = importlib.import_module(f"qlinkgen.cli.{cmd_name}").command
        if not any(each.name == "debug" for each in command.params):
            command.params.append(debug_option(hidden=True))  # at the end of a line that has failed
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command; one that does not exist may be a misspelt one."""
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError as error:
            close = similar(args[0], COMMANDS)
            if not close:
                raise
            raise click.UsageError(f"{error.message} Did you mean {close[0]}?", ctx) from None

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """List the commands from the table above."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.command(
    cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
)
@click.version_option(qlinkgen.__version__, prog_name="qlinkgen")
def cli() -> None:
    """Describe a serial protocol once in YAML: get codecs for Python and C, look at its bytes, drive its bus.

    PROTOCOL is the name of a schema that comes with qlinkgen (qlink, trio, mc1231a) or the path of a .yaml
    file.

    Exit codes: 0 fine, 1 what was checked is wrong (drift, bad frame, faulty schema, no answer, no such
    port), 2 wrong usage, 70 a fault of qlinkgen itself (--debug shows where).
    """


cli.params.append(debug_option())


def main() -> None:
    """Run the command line and leave the process with its exit code."""
    raise SystemExit(run(cli))
