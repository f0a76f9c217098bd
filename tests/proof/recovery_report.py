"""Print the table of docs/recovery.md: `python -m tests.proof.recovery_report`."""

from __future__ import annotations

from tests.proof import recovery
from tests.proof.corruption import EVERY_KIND


def table() -> str:
    """Recovered and intact frames for every kind of corruption, as Markdown."""
    subjects = {"Q.link": recovery.qlink(), "Trio": recovery.trio()}
    if recovery.has_pymavlink():
        subjects["MAVLink 2, pymavlink"] = recovery.mavlink()
    lines = [f"| corruption | {' | '.join(subjects)} |", "|---" * (len(subjects) + 1) + "|"]
    for kind in EVERY_KIND:
        lines.append(f"| {kind} | {' | '.join(cell(each.result(kind)) for each in subjects.values())} |")
    return "\n".join(lines)


def cell(result: recovery.Result) -> str:
    """Recovered and intact frames, and frames that were not sent."""
    share = 100 * result.recovered / result.intact
    strange = f", {result.strange} not sent" if result.strange else ""
    return f"{result.recovered}/{result.intact} = {share:.4g} %{strange}"


if __name__ == "__main__":
    print(table())
    if not recovery.has_pymavlink():
        print("\npymavlink is not installed: pip install pymavlink")
