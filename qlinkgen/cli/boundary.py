"""Turns every error into one line on stderr and an exit code, never a traceback."""

from __future__ import annotations

import os
import sys
import traceback
from pathlib import Path

import click

from qlinkgen.cli import standard_streams
from qlinkgen.errors import QlinkgenError, SchemaError
from qlinkgen.model.texts import visible

FINE, WRONG, USAGE = 0, 1, 2
#: An internal error; EX_SOFTWARE of sysexits.h.
FAULT = 70
#: Variable of the environment by which a shell asks for completion, as click names it.
COMPLETE = "_QLINKGEN_COMPLETE"
#: Exit codes that a shell reports for a program ended by these signals.
INTERRUPTED, BROKEN_PIPE = 130, 141


class Failure(Exception):
    """Ends a command: what was seen, the rule, the fix; and the exit code."""

    def __init__(self, text: str, code: int = USAGE) -> None:
        """Keep the text for stderr."""
        self.text = text
        self.code = code
        super().__init__(text)


def run(cli: click.Command) -> int:
    """Run the command line; return the exit code."""
    standard_streams.prepare()
    _debug.wanted = False
    try:
        code = _invoke(cli)
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        _silence()
        return BROKEN_PIPE
    except (KeyboardInterrupt, click.Abort):
        _silence()
        return _complain("interrupted", INTERRUPTED)
    except OSError as error:
        _silence()
        return _complain(_of_system(error), WRONG)
    except Exception as error:  # noqa: BLE001  # the boundary: every error ends in a line that asks for a report
        _silence()
        return _complain(_unforeseen(error), FAULT)


def _invoke(cli: click.Command) -> int:
    if instruction := os.environ.get(COMPLETE):
        from click.shell_completion import shell_complete  # noqa: PLC0415  # only a shell asks for it

        return shell_complete(cli, {}, "qlinkgen", COMPLETE, instruction)
    try:
        # Not cli.main(): it turns a broken pipe into exit code 1, like a bad frame.
        with cli.make_context("qlinkgen", sys.argv[1:]) as context:
            result = cli.invoke(context)
        return result if isinstance(result, int) else FINE
    except click.exceptions.Exit as error:
        return error.exit_code
    except click.UsageError as error:
        click.UsageError(visible(error.format_message()), error.ctx).show()
        return USAGE
    except click.ClickException as error:
        return _complain(error.format_message(), error.exit_code)
    except Failure as error:
        return _complain(error.text, error.code)
    except SchemaError as error:
        click.echo(visible(str(error)), err=True)
        unreadable = any(fault.rule == "file-unreadable" for fault in error.faults)
        return USAGE if unreadable else WRONG
    except QlinkgenError as error:
        return _complain(str(error), WRONG)


class _Debug:
    """Whether ``--debug`` was given."""

    wanted = False


_debug = _Debug()


def _want_debug(context: click.Context, parameter: click.Parameter, value: bool) -> None:  # noqa: ARG001
    _debug.wanted = _debug.wanted or value


def debug_option(*, hidden: bool = False) -> click.Option:
    """Return the option ``--debug``, of the command line as a whole or of a command."""
    return click.Option(
        ["--debug"],
        is_flag=True,
        expose_value=False,
        is_eager=True,
        hidden=hidden,
        callback=_want_debug,
        help="Show the traceback of an internal error.",
    )


def _unforeseen(error: Exception) -> str:
    """Show the traceback if requested; return the line that asks for a report."""
    if _debug.wanted:
        click.echo("".join(traceback.format_exception(error)), err=True, nl=False)
    frame = traceback.extract_tb(error.__traceback__)[-1]
    what = _one_line(f"{type(error).__name__}: {error}".rstrip(": "))
    where = f"{Path(frame.filename).name}:{frame.lineno}"
    report = "the traceback" if _debug.wanted else "the output of the same command with --debug"
    return f"internal error ({what}; {where}); please report it with {report}"


def _one_line(text: str) -> str:
    """Return text without line breaks or other control characters, which a terminal would interpret."""
    return "".join(each if each.isprintable() else repr(each)[1:-1] for each in text)


def _complain(text: str, code: int) -> int:
    click.echo(f"qlinkgen: error: {visible(text)}", err=True)
    return code


def _of_system(error: OSError) -> str:
    where = f" {error.filename}" if error.filename else ""
    fix = "check free space, permissions and the path"
    return f"system error{where}: {error.strerror or error}; {fix}"


def _silence() -> None:
    """Redirect stdout to nothing: flushing its buffer at exit would fail again."""
    try:
        target = sys.stdout.fileno()
    except (OSError, ValueError):  # closed, or not a real file
        sys.stdout = standard_streams.nothing()
        return
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, target)
    os.close(nothing)
