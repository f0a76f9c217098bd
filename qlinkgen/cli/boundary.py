"""Where every error ends: one line of text on stderr and an exit code, never a traceback."""

from __future__ import annotations

import io
import os
import sys

import click

from qlinkgen.errors import QlinkgenError, SchemaError
from qlinkgen.model.texts import visible

FINE, WRONG, USAGE = 0, 1, 2
#: What a shell reports of a program that these signals ended.
INTERRUPTED, BROKEN_PIPE = 130, 141


class Failure(Exception):
    """Ends a command: what was seen, the rule, the fix; and the exit code."""

    def __init__(self, text: str, code: int = USAGE) -> None:
        """Keep the text for stderr."""
        self.text = text
        self.code = code
        super().__init__(text)


def run(cli: click.Command) -> int:
    """Run the command line; the exit code."""
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


def _invoke(cli: click.Command) -> int:
    try:
        # Not cli.main(): that turns a broken pipe into exit code 1, like a bad frame.
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


def _complain(text: str, code: int) -> int:
    click.echo(f"qlinkgen: error: {visible(text)}", err=True)
    return code


def _of_system(error: OSError) -> str:
    where = f" {error.filename}" if error.filename else ""
    fix = "check free space, permissions and the path"
    return f"the system refused{where}: {error.strerror or error}; {fix}"


def _silence() -> None:
    """Point stdout at nothing: what is still in its buffer would fail again while Python shuts down."""
    try:
        target = sys.stdout.fileno()
    except (OSError, ValueError):  # closed, or no real file
        sys.stdout = io.StringIO()
        return
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, target)
    os.close(nothing)
