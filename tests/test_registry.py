"""Hand-written behaviour of protocols is found in one place, by what a schema states."""

from __future__ import annotations

import io
import re
import tokenize
from pathlib import Path

import pytest

import qlinkgen
from qlinkgen._resources import schemas_dir
from qlinkgen.protocols.registry import codec_of, support_of, supported
from qlinkgen.protocols.support import Support
from qlinkgen.schema import find, load, loads

NAMES = ("qlink", "trio", "mc1231a")
SOURCES = Path(qlinkgen.__file__).parent
#: Command-line parts of what is written by hand for one protocol.
OWN = {
    "cli/keypad_screens.py", "cli/ring_console.py", "cli/ring_place.py", "cli/ring_programs.py",
    "cli/simulate_host.py", "cli/simulate_ring.py", "cli/send_ring.py",
    "sim/chip_bus.py", "sim/key_script.py", "sim/port_ring.py", "sim/virtual_ring.py",
}  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_a_schema_of_the_package_has_its_behaviour_wherever_its_file_is(name: str, tmp_path: Path) -> None:
    copy = tmp_path / "copy.yaml"
    copy.write_bytes((schemas_dir() / f"{name}.yaml").read_bytes())
    for protocol in (load(find(name)), load(copy)):
        assert type(support_of(protocol)) is not Support or name == "trio"
        assert codec_of(protocol).__name__ == f"qlinkgen.codecs.{name}"  # type: ignore[union-attr]
        assert supported(protocol.bus.kind) == [name]


@pytest.mark.parametrize("name", NAMES)
def test_a_changed_copy_has_the_behaviour_of_any_schema(name: str) -> None:
    text = (schemas_dir() / f"{name}.yaml").read_text(encoding="utf-8")
    changed, faults = loads(text.replace("title: ", "title: Changed ", 1), "changed.yaml")
    assert changed is not None, faults
    assert changed.name == name
    assert support_of(changed) == Support(name)
    assert codec_of(changed) is None


def test_general_code_names_no_protocol() -> None:
    folders = ("backends", "bus", "captures", "cli", "link", "model", "plan", "schema", "sim", "transport")
    word = re.compile(r"\b(qlink|trio|mc1231a)\b")
    found = []
    for path in (path for folder in folders for path in sorted((SOURCES / folder).rglob("*.py"))):
        where = path.relative_to(SOURCES).as_posix()
        if where not in OWN:
            tokens = tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline)
            code = [each for each in tokens if each.type == tokenize.NAME or _is_name(each)]
            found += [f"{where}:{each.start[0]}" for each in code if word.search(each.string)]
    assert found == []


def _is_name(token: tokenize.TokenInfo) -> bool:
    """Whether a token is text that may be compared, not a docstring or a sentence."""
    return token.type == tokenize.STRING and " " not in token.string
