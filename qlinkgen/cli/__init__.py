"""The command line. The module of a command is imported on use, so that ``--help`` is fast."""

from __future__ import annotations

import importlib
import keyword

import click

import qlinkgen
from qlinkgen.cli.boundary import debug_option, run
from qlinkgen.model.spelling import similar

#: Command to its line in `qlinkgen --help`; the command itself is `command` in the module of its name.
COMMANDS = {
    "generate": "Write Python, C, construct and vectors for protocols, or check that they are up to date.",
    "lint": "Check schema files; report every error with its line, column, rule and fix.",
    "list": "List the protocols of qlinkgen.",
    "init": "Write a schema to begin with.",
    "import": "Write a schema from a C header, a table and other formats.",
    "show": "Show a protocol or a message: layout, sizes, transactions.",
    "encode": "Encode values as wire bytes.",
    "decode": "Decode wire bytes: one JSON object per line.",
    "explain": "Describe every byte of a frame, and its errors.",
    "stats": "Print statistics of captures: use of the line, response times, missing answers, faults.",
    "export": "Write the frames of captures as tables.",
    "coverage": "Print which messages and values captures have exercised.",
    "crc": "List check values, or find those that fit frames.",
    "budget": "Compute the duration of a cycle of requests, and its share of the line.",
    "simulate": "Simulate nodes, a ring or a chip set on a new port, with optional faults.",
    "scan": "Find the nodes of a bus.",
    "send": "Send one request on a port and print its response, or one message into a ring.",
    "shell": "Send requests to a bus line by line, with completion and units.",
    "fuzz": "Send valid, wrong and damaged frames to a device, and report what it does wrong.",
    "load": "Load an Intel HEX file into a Q.link node.",
    "monitor": "Listen to a bus or a fibre: requests, responses, repeats, late and damaged frames.",
    "ring": "Join a Trio ring as a passive node: forward and print every message.",
    "doctor": "Report what a serial port can do, what its latency costs, and what to change.",
}


class LazyGroup(click.Group):
    """A group that lists its commands without importing them."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002  # click's interface
        """Names, in the order of a user's work."""
        return [*COMMANDS]  # the name of the builtin is that of a module here, once it is imported

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        """Import a command when it is used."""
        if cmd_name not in COMMANDS:
            return None
        module = f"{cmd_name}_" if keyword.iskeyword(cmd_name) else cmd_name
        command: click.Command = importlib.import_module(f"qlinkgen.cli.{module}").command
        if not any(each.name == "debug" for each in command.params):
            command.params.append(debug_option(hidden=True))  # to be appended to a failed command line
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command; suggest the nearest name for an unknown one."""
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
            formatter.write_dl([*COMMANDS.items()])


@click.command(
    cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
)
@click.version_option(qlinkgen.__version__, prog_name="qlinkgen")
def cli() -> None:
    """Generate codecs for Python and C from the schema of a serial protocol, inspect frames, drive the bus.

    PROTOCOL is a name that `qlinkgen list` prints (qlink, modbus_rtu) or the path of a .yaml file.

    Exit codes: 0 success, 1 failed check (drift, bad frame, invalid schema, no answer, no such port), 2 usage
    error, 70 internal error (--debug shows the traceback).
    """


cli.params.append(debug_option())


def main() -> None:
    """Run the command line and exit with its exit code."""
    raise SystemExit(run(cli))
