"""Soak the example firmware: `python -m tests.soak.firmware [--transactions N] [--targets NAME...]`.

Each port of the Q.link node is built, runs as a process or on an emulator, and gets a random mix of all
requests among damaged frames, foreign ones and noise; every answer has to be that of a model. `--output PATH`
writes the figures as a section of that page.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

from qlinkgen.transport import open_port
from tests.firmware import firmware, line
from tests.soak import firmware_page as page
from tests.soak import firmware_run as run


def main(arguments: list[str] | None = None) -> int:
    """Run the soak on each port; 1 if a result is wrong, 2 if a tool is missing."""
    options = _options(arguments, list(firmware.TARGETS))
    if options.output and not Path(options.output).exists():
        print(
            f"soak.firmware: {options.output} does not exist; name an existing page to update",
            file=sys.stderr,
        )
        return 2
    missing = [_missing(firmware.TARGETS[target]) for target in options.targets]
    if packages := sorted(set().union(*missing)):
        print(f"soak.firmware: to build and run these ports install {' '.join(packages)}", file=sys.stderr)
        return 2
    results = []
    with tempfile.TemporaryDirectory(prefix="qlinkgen-firmware-") as folder:
        for target in options.targets:
            results.append(_soak(target, Path(options.build or folder), options))
            print(page.as_text(results[-1]), flush=True)
    complaints = [result.complaint for result in results if result.complaint]
    if options.output and not complaints:
        output = Path(options.output)
        output.write_text(page.put_into(output.read_text(encoding="utf-8"), results), encoding="utf-8")
    for complaint in complaints:
        print(f"soak.firmware: {complaint}", file=sys.stderr)
    return 1 if complaints else 0


def _missing(target: firmware.Target) -> set[str]:
    """Return the Debian packages that a port lacks."""
    tools = {package for tool, package in (("make", "make"), *target.tools) if shutil.which(tool) is None}
    headers = {
        package
        for header, compiler, package in target.headers
        if shutil.which(compiler) is not None and not firmware.has_header(header, compiler)
    }
    return tools | headers


def _soak(target: str, folder: Path, options: argparse.Namespace) -> run.Result:
    program = firmware.build(target, "qlink_node", folder, firmware.TARGETS[target].options)
    with firmware.Firmware(target, program) as running, open_port(running.path) as port:
        up = line.FirmwareLine(port)
        up.wait_until_up()
        soak = run.Soak(target, up, options.seed)
        try:
            soak.run(options.transactions)
        except run.WrongAnswer as found:
            soak.result.complaint = str(found)
        return soak.result


def _options(arguments: list[str] | None, targets: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Soak the example firmware on emulated chips.")
    parser.add_argument("--transactions", type=int, default=20_000, help="with each port")
    parser.add_argument(
        "--targets", nargs="+", choices=targets, default=targets, help="ports, all by default"
    )
    parser.add_argument("--seed", type=int, default=1, help="of all random numbers")
    parser.add_argument("--build", help="folder for the programs, kept if given")
    parser.add_argument("--output", help="put the figures into this page, if nothing is wrong")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
