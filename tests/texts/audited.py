"""Runs commands of the command line under an audit hook, and prints forbidden events.

    python audited.py MODULE,MODULE... WORD COMMANDS.json

The modules must not be imported, and compiled code must not contain the word.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

#: Events that start a process, reach a network, or change a file.
FORBIDDEN = (
    *("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.spawn", "os.fork", "pty.spawn"),
    *("socket.connect", "socket.bind", "ctypes.dlopen", "webbrowser.", "pickle.find_class"),
    *("os.remove", "os.rename", "os.mkdir", "os.rmdir", "os.link", "os.symlink", "os.truncate"),
    *("os.chmod", "os.utime", "shutil.", "tempfile."),
)
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


def main() -> None:
    """Run the commands one after the other; returns their exit codes."""
    from qlinkgen.cli import cli
    from qlinkgen.cli.boundary import run

    modules, word = sys.argv[1].split(","), sys.argv[2]
    commands = json.loads(Path(sys.argv[3]).read_text("utf-8"))
    seen: list[str] = []

    def hook(event: str, arguments: tuple[object, ...]) -> None:
        if event.startswith(FORBIDDEN):
            seen.append(f"{event} {arguments!r}")
        elif event == "open" and isinstance(arguments[2], int) and arguments[2] & WRITING:
            seen.append(f"open {arguments!r}")
        elif event == "import" and arguments[0] in modules:
            seen.append(f"import {arguments[0]}")
        elif event == "compile" and word in _source(arguments[0]):
            seen.append(f"compile {arguments[1]}")

    sys.addaudithook(hook)
    codes = []
    for command in commands:
        sys.argv = ["qlinkgen", *command]
        codes.append(run(cli))
    sys.stdout.flush()
    sys.stderr.write("\n" + json.dumps({"codes": codes, "seen": seen}))


def _source(source: object) -> str:
    return source.decode("utf-8", "replace") if isinstance(source, bytes) else str(source)


if __name__ == "__main__":
    main()
