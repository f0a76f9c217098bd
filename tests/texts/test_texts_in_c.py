"""Texts of a schema are comments in C files, and strings in JSON."""

from __future__ import annotations

import functools
import json
import re
import subprocess
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pytest

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.cli.targets import TARGETS
from qlinkgen.model.protocol import Protocol
from tests.support.cdriver import WARNINGS
from tests.texts.samples import CASES, HARMLESS, harmless, turned
from tests.texts.slots import SCHEMAS, protocol_of

_TRIGRAPHS = dict(zip("=/'()!<>-", "#\\^[]|{}~", strict=True))
#: The revision, a literal of plain characters and numbers, and the hash of the schema's text.
_STAMPS = re.compile(
    r'^#define \w+_SCHEMA_(REVISION "(?:[^"\\\n?]|\\[0-7]{3})*"|HASH 0x[0-9A-F]{8}UL)$', re.MULTILINE
)
_COMMENT_OR_STRING = re.compile(r'/\*.*?\*/|"(?:[^"\\\n]|\\.)*"', re.DOTALL)


def tokens(source: str) -> Sequence[str]:
    """The code as compiled: trigraphs replaced, lines spliced, comments removed."""
    text = re.sub(r"\?\?([=/'()!<>-])", lambda found: _TRIGRAPHS[found[1]], source)
    text = text.replace("\\\n", "")
    text = _COMMENT_OR_STRING.sub(lambda found: found[0] if found[0].startswith('"') else " ", text)
    return text.split()


def header(protocol: Protocol) -> str:
    text, stamps = _STAMPS.subn("", "".join(c.generate(protocol, Options()).values()))
    assert stamps == 2
    return text


@functools.cache
def tokens_of(name: str, texts: tuple[str, ...]) -> Sequence[str]:
    return tokens(header(protocol_of(name, texts)))


def generated(target: str, protocol: Protocol) -> Mapping[str, str]:
    generate = TARGETS[target].load()
    return generate(protocol, Options())


@pytest.mark.parametrize(("name", "texts"), CASES)
def test_the_header_without_comments_is_that_of_harmless_texts(name: str, texts: tuple[str, ...]) -> None:
    found = header(protocol_of(name, texts))
    assert tokens(found) == tokens_of(name, harmless(texts))
    assert not re.search(r"\?\?/", found)


@pytest.mark.parametrize("name", SCHEMAS)
def test_headers_and_kits_compile(name: str, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    compiler = require_tool("gcc", package="gcc")
    sources = []
    for turn, texts in enumerate(turned(15)):
        protocol = protocol_of(name, texts)
        folder = tmp_path / str(turn)
        for target in ("c", "conformance"):
            for path, text in generated(target, protocol).items():
                (folder / path).parent.mkdir(parents=True, exist_ok=True)
                (folder / path).write_text(text, "utf-8")
        (kit,) = folder.glob("conformance/*.c")
        kit.rename(folder / "c" / kit.name)
        sources.append(folder / "c" / kit.name)
    flags = ("-std=c99", "-trigraphs", "-fsyntax-only", *WARNINGS)
    defines = ("-DCONFORMANCE_STDIO=1", f"-D{name.upper()}_ENABLE_FLOAT=1")
    command = [compiler, *flags, *defines, *map(str, sources)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:4000]


@pytest.mark.parametrize("name", SCHEMAS)
def test_vectors_are_those_of_harmless_texts(name: str) -> None:
    def document(*texts: str) -> Mapping[str, object]:
        (text,) = generated("vectors", protocol_of(name, texts)).values()
        found: Mapping[str, object] = json.loads(text)
        return found

    plain = document(HARMLESS)
    for texts in turned(15):
        found = document(*texts)
        assert {**found, "about": None} == {**plain, "about": None}
        about = found["about"]
        assert isinstance(about, list)
        protocol = protocol_of(name, texts)
        assert about[0] == f"{protocol.title}, revision {protocol.revision}"
