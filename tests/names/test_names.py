"""Any word may be a name: what is generated for a schema of such words compiles, and carries messages."""

from __future__ import annotations

import functools
import re
import subprocess
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
import yaml

from qlinkgen.backends import c, construct, python
from qlinkgen.backends.base import Options
from qlinkgen.backends.python import bus, load
from qlinkgen.cli.targets import TARGETS
from qlinkgen.model.naming import attribute
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.values import default_of
from qlinkgen.plan import plan_of
from qlinkgen.schema import loads
from tests.names import schemas, words
from tests.support.cdriver import WARNINGS

conformance = TARGETS["conformance"].load()
#: Names that no table of words has, for what a schema needs besides.
PLAIN = tuple(f"zz{letter}" for letter in "abcdefgh")
FLAGS = ("-std=c99", "-fsyntax-only", *WARNINGS)


def protocol_of(data: Mapping[str, Any]) -> Protocol:
    """The protocol of a schema that lint accepts."""
    protocol, faults = loads(yaml.safe_dump(data, sort_keys=False), "words.yaml")
    assert protocol is not None, [str(fault) for fault in faults][:10]
    return protocol


@functools.cache
def plain(frame: str, group: str) -> Protocol:
    return protocol_of(schemas.crowd(frame, group, PLAIN[:6]))


@functools.cache
def in_python(frame: str) -> frozenset[str]:
    """Names of the modules that are generated for a frame."""
    found: set[str] = set()
    for group in schemas.GROUPS:
        protocol = plain(frame, group)
        for generate in (python.generate, bus.generate, construct.generate):
            outputs = generate(protocol, Options())
            found |= words.of_module(words.sources_of(outputs, (f"/{protocol.name}.py", "_bus.py", "__.py")))
    return frozenset(word for word in found if not re.search(r"zz|^p\d$|sample", word))


@functools.cache
def in_c(frame: str) -> frozenset[str]:
    """Names of the headers and kits that are generated for a frame."""
    found: set[str] = set()
    for group in schemas.GROUPS:
        protocol = plain(frame, group)
        for generate in (c.generate, conformance):
            text = words.sources_of(generate(protocol, Options()), (".h", ".c"))
            found |= words.of_c(text, protocol.name)
    return frozenset(word for word in found if not re.search(r"zz|^p\d$|sample", word))


def chunks(found: Iterable[str], frame: str) -> list[tuple[str, ...]]:
    size = min(schemas.FRAMES[frame].ids - 1, 180)
    ordered = sorted(found)
    return [tuple(ordered[first : first + size]) for first in range(0, len(ordered), size)]


def padded(part: Sequence[str]) -> list[str]:
    return [*part, *PLAIN[len(part) :]] if len(part) < 6 else list(part)


def runs(protocol: Protocol) -> None:
    """The modules compile; the codec is imported, and carries every message."""
    codec = load(protocol)
    compile(bus.render(plan_of(protocol, Options())), "bus", "exec")
    for text in construct.generate(protocol, Options()).values():
        compile(text, "construct", "exec")
    for name, message in codec.MESSAGES.items():
        values = {attribute(each.name): default_of(each) for each in protocol.by_name[name].values}
        made = message(**values, **({message.ADDRESS: 1} if message.ADDRESS else {}))
        payload = made.to_bytes()
        assert message.from_bytes(payload, *([1] if message.ADDRESS else [])) == made, name
        for each in message.FIELDS:
            getattr(made, each)


def compiles(protocols: Sequence[Protocol], folder: Path, compiler: str, *, kit: bool) -> None:
    """Headers, and kits if wanted, compile under the strict flags, beside every header of the library."""
    sources = []
    for turn, protocol in enumerate(protocols):
        own = folder / f"own{turn}"
        own.mkdir()
        outputs = {
            **c.generate(protocol, Options()),
            **(conformance(protocol, Options()) if kit else {}),
        }
        for path, text in outputs.items():
            (own / Path(path).name).write_text(text, "utf-8")
        (header,) = (path.name for path in own.glob("*.h"))
        program = own / "program.c"
        program.write_text(f'{words.INCLUDES}#include "{header}"\n', "utf-8")
        sources += [program, *own.glob("*_conformance.c")]
    defines = ("-D_GNU_SOURCE", "-DCONFORMANCE_STDIO=1")
    command = [compiler, *FLAGS, *defines, *map(str, sources)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, "\n".join(re.findall(r".*error:.*", done.stderr)[:12])


@pytest.mark.parametrize("group", schemas.GROUPS)
@pytest.mark.parametrize("frame", schemas.FRAMES)
def test_python_of_every_word(frame: str, group: str) -> None:
    found = in_python(frame) | words.of_python()
    if frame != "streamed":
        found = in_python(frame) - in_python("streamed") - words.of_python()
    for part in chunks(found, frame):
        runs(protocol_of(schemas.crowd(frame, group, padded(part))))


@pytest.mark.parametrize("group", schemas.GROUPS)
@pytest.mark.parametrize("frame", schemas.FRAMES)
def test_c_of_every_word(frame: str, group: str, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    compiler = require_tool("gcc", package="gcc")
    found = in_c(frame) | words.macros(compiler) | {*words.C_KEYWORDS}
    if frame != "streamed":
        found = in_c(frame) - in_c("streamed") - words.macros(compiler) - {*words.C_KEYWORDS}
    protocols = [protocol_of(schemas.crowd(frame, group, padded(part))) for part in chunks(found, frame)]
    compiles(protocols, tmp_path, compiler, kit=group == "flags" or frame == "marked")


@pytest.mark.parametrize("frame", ["streamed", "rescanned", "packet"])
def test_parts_and_protocols_of_every_word(
    frame: str, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    compiler = require_tool("gcc", package="gcc")
    found = sorted({*words.C_KEYWORDS, *words.FILES, *in_python(frame), *_locals(frame)})
    protocols = []
    for index, word in enumerate(found):
        parts = [f"p{number}" for number in range(schemas.FRAMES[frame].parts)]
        parts[3 if len(parts) > 3 else index % len(parts)] = word
        protocol = protocol_of(schemas.single(frame, word, parts))
        runs(protocol)
        protocols.append(protocol)
    compiles(protocols, tmp_path, compiler, kit=False)


def _locals(frame: str) -> frozenset[str]:
    """Identifiers of a header that are not the protocol's own."""
    text = words.sources_of(c.generate(plain(frame, "enums"), Options()), (".h",))
    bare = re.sub(r'/\*.*?\*/|"[^"\n]*"', " ", text, flags=re.DOTALL)
    return (
        frozenset(re.findall(r"\b[a-z][a-z0-9_]*\b", bare))
        - {"zz"}
        - frozenset(re.findall(r"\bsample\w*|\w*zz\w*", bare))
    )
