"""What every test may use: tools with an honest skip, and Hypothesis profiles.

A test asks for a program by `require_tool("clang", package="clang")`. Without it the test is skipped, and the
summary names the Debian package. With QLINKGEN_NO_SKIPS=1 nothing may be skipped: any skip is a failure.
The one exception is a test that is marked `optional_tool("cbmc")` and has asked for that program by
`optional_tool("cbmc", how="...")`, or for a document in the same way; the summary tells of it all the same.
"""

from __future__ import annotations

import os
import re
import secrets
import shutil
import signal
from collections import Counter
from collections.abc import Callable, Generator
from pathlib import Path
from typing import NoReturn

import pytest
from hypothesis import HealthCheck, Phase, settings

from tests.support import needs

#: Tests read every schema, and write nothing to the user's folders.
os.environ["QLINKGEN_CACHE"] = ""

NO_SKIPS = os.environ.get("QLINKGEN_NO_SKIPS", "") not in {"", "0"}

# The notice travels as text: under xdist a report is all that reaches the process that prints the summary.
NOTICE = "needs {what} (Debian package {package})"
NOTICE_PATTERN = re.compile(r"needs (?P<what>.+) \(Debian package (?P<package>[^\s)]+)\)")

OPTIONAL_NOTICE = "needs {tool}, which is optional: {how}"
OPTIONAL_PATTERN = re.compile(r"needs (?P<tool>\S+), which is optional: (?P<how>.+)")

# Generated code is compiled and imported inside examples, so no deadline is meaningful on a shared machine.
settings.register_profile("dev", deadline=None)
settings.register_profile(
    "ci", deadline=None, derandomize=True, print_blob=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile("fast", deadline=None, max_examples=20)
# For tests/mutants: that an example fails is enough, and making it small takes longest.
settings.register_profile(
    "mutants",
    settings.get_profile("ci"),
    database=None,
    phases=(Phase.explicit, Phase.generate),
    report_multiple_bugs=False,
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci" if os.environ.get("CI") else "dev"))


def pytest_xdist_auto_num_workers() -> int:
    """Run one more than there are processors: a third of the time goes by waiting for other processes."""
    return (os.cpu_count() or 1) + 1


def pytest_configure(config: pytest.Config) -> None:
    """Heed Ctrl-C and hang-ups: background jobs may not, and neither would the programs that tests start.

    Also choose new random schemas, say which marker allows a skip, and let `tests.support.needs` mark tests.
    """
    config.pluginmanager.register(needs)
    config.addinivalue_line(
        "markers", "optional_tool(name): may be skipped where this program or document is not to be had"
    )
    # Workers inherit it, as they must all see the same tests.
    os.environ.setdefault("QLINKGEN_SCHEMAS", str(secrets.randbelow(10**9)))
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_report_header() -> str:
    """Tell the seed of new random schemas."""
    return f"random schemas: QLINKGEN_SCHEMAS={os.environ['QLINKGEN_SCHEMAS']}"


def _missing(what: str, *, package: str) -> NoReturn:
    notice = NOTICE.format(what=what, package=package)
    if NO_SKIPS:
        pytest.fail(f"{notice}, and QLINKGEN_NO_SKIPS allows no skip", pytrace=False)
    pytest.skip(notice)


def _require(tool: str, *, package: str) -> str:
    return shutil.which(tool) or _missing(tool, package=package)


@pytest.fixture(scope="session")
def require_tool() -> Callable[..., str]:
    """Return a function that gives the path of a program, or skips and names its Debian package."""
    return _require


@pytest.fixture(scope="session")
def missing_tool() -> Callable[..., NoReturn]:
    """Return a function to skip with when a program is there but a part of it is not (a runtime, a libc)."""
    return _missing


@pytest.fixture(scope="session")
def optional_tool() -> Callable[..., str]:
    """Return a function that gives the path of a program, or skips and says how to get it."""

    def find(tool: str, *, how: str) -> str:
        return shutil.which(tool) or pytest.skip(OPTIONAL_NOTICE.format(tool=tool, how=how))

    return find


@pytest.fixture(scope="session")
def document() -> Callable[[str], str]:
    """Return a function that reads a source document, or skips: documents are not part of the repository."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "spec" / "source"

    def read(name: str) -> str:
        path = folder / name
        if not path.exists():
            pytest.skip(OPTIONAL_NOTICE.format(tool=name, how="put it into ../shared/spec/source"))
        return path.read_text("utf-8")

    return read


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder that all workers of this session have in common: see `tests.support.sharing`."""
    base = tmp_path_factory.getbasetemp()
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


def _reason(report: pytest.TestReport | pytest.CollectReport) -> str:
    # A skip is reported as (file, line, reason).
    return report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)


def _forbid_skip(report: pytest.TestReport | pytest.CollectReport, optional: str = "") -> None:
    # An expected failure is also reported as "skipped"; that one says something and may stay.
    if not NO_SKIPS or not report.skipped or hasattr(report, "wasxfail"):
        return
    found = OPTIONAL_PATTERN.search(_reason(report))
    if not found or found["tool"] != optional:
        report.outcome = "failed"
        report.longrepr = f"QLINKGEN_NO_SKIPS allows no skip: {_reason(report)}"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Turn a skipped test into a failed one where nothing may be skipped."""
    report = yield
    marker = item.get_closest_marker("optional_tool")
    _forbid_skip(report, marker.args[0] if marker else "")
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Do the same for a module that skips itself while it is imported."""
    report = yield
    _forbid_skip(report)
    return report


def _skips_by_package(terminalreporter: pytest.TerminalReporter) -> dict[str, tuple[str, int]]:
    skips: dict[str, tuple[str, int]] = {}
    for report in terminalreporter.stats.get("skipped", []):
        if found := NOTICE_PATTERN.search(_reason(report)):
            what, package = found["what"], found["package"]
            skips[package] = (what, skips.get(package, ("", 0))[1] + 1)
    return skips


def _optional_skips(terminalreporter: pytest.TerminalReporter) -> Counter[tuple[str, str]]:
    reasons = [_reason(report) for report in terminalreporter.stats.get("skipped", [])]
    found = [OPTIONAL_PATTERN.search(reason) for reason in reasons]
    return Counter((each["tool"], each["how"]) for each in found if each)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """List the tools that were missing, what that cost, and the one command that brings them."""
    skips, optional = _skips_by_package(terminalreporter), _optional_skips(terminalreporter)
    if not skips and not optional:
        return
    terminalreporter.section("skipped for missing tools")
    for (tool, how), count in sorted(optional.items()):
        terminalreporter.line(
            f"{count:5} test{'s' if count > 1 else ' '} without {tool}, which is optional: {how}"
        )
    for package, (what, count) in sorted(skips.items()):
        terminalreporter.line(f"{count:5} test{'s' if count > 1 else ' '} without {what}: package {package}")
    if skips:
        terminalreporter.line(f"To run them: apt-get install {' '.join(sorted(skips))}")
