"""Generated documents: the page of rules, and the JSON Schema for editors.

The examples on the page of rules are broken files of the tests, so the page shows the actual messages.
"""

from __future__ import annotations

import json
from pathlib import Path

from qlinkgen._resources import schemas_dir
from qlinkgen.errors import Fault
from qlinkgen.schema.file_model import json_schema
from qlinkgen.schema.loader import loads
from qlinkgen.schema.rules import RULES, Rule

_BROKEN = Path("tests", "schema", "broken")
_INTRODUCTION = """\
# Rules for schema files

<!-- Generated from qlinkgen/schema/rules.py and tests/schema/broken; do not edit. -->

`qlinkgen lint FILE` checks a schema file and reports all errors in one run, each with its location, the
violated rule and a fix:

```
file:line:col: error[RULE]: error; fix
```

A file with errors cannot be used, a file with only warnings can. Errors that may be consequences of another
error are suppressed: fix the reported ones and run again.
"""


def outputs(root: Path | None = None) -> dict[str, str]:
    """Texts of the generated pages by their path below the repository.

    Args:
        root: The repository, for the examples; without its tests the page of rules has no examples.
    """
    root = root or schemas_dir().parent
    return {
        "docs/rules.md": rules_page(root / _BROKEN),
        "docs/schema/qlinkgen.schema.json": json_schema_text(),
    }


def json_schema_text() -> str:
    """The JSON Schema of the file format."""
    return json.dumps(json_schema(), indent=2, ensure_ascii=False) + "\n"


def rules_page(examples: Path) -> str:
    """The page of rules: summary, reason and examples of each."""
    rows = "".join(
        f"| [{rule.id}](#{rule.id}) | {rule.severity} | {rule.summary} |\n" for rule in RULES.values()
    )
    table = f"\n| rule | severity | |\n|---|---|---|\n{rows}"
    return _INTRODUCTION + table + "".join(_section(rule, examples) for rule in RULES.values())


def _section(rule: Rule, examples: Path) -> str:
    text = f"\n## {rule.id}\n\n{rule.severity.capitalize()}. {rule.summary} {rule.reason}\n"
    file = examples / f"{rule.id}.yaml"
    if not file.is_file():
        return text
    source = file.read_text(encoding="utf-8")
    faults = [fault for fault in loads(source, file.name)[1] if fault.rule == rule.id]
    said = "\n".join(str(fault) for fault in sorted(faults))
    return f"{text}\n```yaml\n{_excerpt(source, faults)}\n```\n```\n{said}\n```\n"


def _excerpt(source: str, faults: list[Fault]) -> str:
    """The lines with faults, the lines nested below them, and their parents."""
    lines = source.splitlines()
    shown = {line for fault in faults for line in _context(lines, fault.line - 1)}
    return "\n".join(lines[line].replace("\t", "→") for line in sorted(shown))


def _context(lines: list[str], at: int) -> list[int]:
    """A line, the lines nested below it, and its parents."""
    found = [at]
    below = at + 1
    while below < len(lines) and lines[below].strip() and _indent(lines[below]) > _indent(lines[at]):
        found.append(below)
        below += 1
    depth = _indent(lines[at])
    for line in range(at - 1, 0, -1):
        if lines[line].strip() and _indent(lines[line]) < depth:
            found.append(line)
            depth = _indent(lines[line])
    return found


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())
