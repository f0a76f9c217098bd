"""Arguments that many commands have, with their completion in a shell."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import click

from qlinkgen._resources import library_dir, schemas_dir
from qlinkgen.cli.boundary import Failure

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

#: Completes a word of a parameter.
Complete: TypeAlias = "Callable[[click.Context, click.Parameter, str], list[CompletionItem]]"


def _completing(name: str) -> Complete:
    """Return a function of `qlinkgen.cli.completion`, which only shells need."""

    def complete(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
        module = importlib.import_module("qlinkgen.cli.completion")
        found: list[CompletionItem] = getattr(module, name)(context, parameter, incomplete)
        return found

    return complete


def _protocol(context: click.Context, parameter: click.Parameter, value: str) -> str:  # noqa: ARG001
    """Refuse a port in place of the protocol: until 0.1, the port was first."""
    if is_port(value) and not _is_schema(value):
        raise Failure(
            f"'{value}' is a port, and PROTOCOL comes before PORT; write qlinkgen {context.info_name} "
            f"PROTOCOL {value}"
        )
    return value


def is_port(name: str) -> bool:
    """Whether a name can only be that of a port: a device or a URL."""
    return "://" in name or name.startswith("/dev/") or Path(name).is_char_device()


def _is_schema(name: str) -> bool:
    folders = (schemas_dir(), library_dir())
    return name.endswith((".yaml", ".yml")) or any((each / f"{name}.yaml").is_file() for each in folders)


#: PROTOCOL.
protocol_argument = click.argument("protocol", shell_complete=_completing("protocols"))
#: PROTOCOL of a command that has a port too.
driven_protocol_argument = click.argument(
    "protocol", callback=_protocol, shell_complete=_completing("protocols")
)
#: PORT.
port_argument = click.argument("port", shell_complete=_completing("ports"))
#: [PORT], of a command that also has traffic from elsewhere.
optional_port_argument = click.argument("port", required=False, shell_complete=_completing("ports"))
#: [MESSAGE], after PROTOCOL.
message_argument = click.argument("message", required=False, shell_complete=_completing("messages"))
#: [FIELD=VALUE]..., after MESSAGE.
assignments_argument = click.argument(
    "assignments", metavar="[FIELD=VALUE]...", nargs=-1, shell_complete=_completing("assignments")
)
