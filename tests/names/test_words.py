"""Every word as every kind of name: lint accepts it, and all targets agree on it.

Where a schema has many names of a kind, one schema has all words. The parts of a frame and the protocol have
one name each, so each word gets a schema, and all their headers are compiled as one file.
"""

from __future__ import annotations

import keyword
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path

import pytest

from qlinkgen.backends import construct, python
from qlinkgen.backends.base import Options
from qlinkgen.backends.vectors import choice
from qlinkgen.backends.vectors.choice import Chance
from qlinkgen.cli.targets import TARGETS
from qlinkgen.model import naming
from qlinkgen.model.message import Value
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.types import Blob, Scalar
from qlinkgen.model.values import native_from_raw
from qlinkgen.plan import plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.plan.content import Raw
from tests.names import words
from tests.names.documents import PLAIN_PARTS, Document, Json, frame, packet
from tests.proof.outputs import plain_numbers
from tests.python.test_bus import loaded
from tests.support.cdriver import WARNINGS
from tests.support.sharing import made_once

#: Types of the schema language, which names must not hide.
BUILT_IN = ("bool", "bytes", "text")
INTEGER = re.compile(r"[ui][0-9]+")
STRICT = (*WARNINGS, "-fsyntax-only")
COMPILERS = {
    "gcc": ("-std=c99",),
    "clang": ("-std=c2x",),
    "g++": ("-std=c++20", "-Wno-missing-field-initializers"),
}
Commands = Mapping[str, tuple[Mapping[str, Json], Mapping[str, Json]]]
LEAST: Commands = {"zz": ({"qq": "u8"}, {"qq": "u8"})}
NEUTRAL = (
    Document(
        enums={"ee": ["mm", "nn"]},
        flags={"ff": ["oo"]},
        types=["tt"],
        commands={"zz": ({"qq": "u8"}, {"yy": {"type": "u8", "counts": "xx"}, "xx": "u16[0..3]"})},
        messages={"ww": {"ss": "tt", "rr": "ee", "vv": "ff", "uu": "text[4]", "bb": "bytes[0..9]"}},
    ),
    Document(frame=frame(PLAIN_PARTS, stuffed=True), commands=LEAST),
    Document(frame=frame(PLAIN_PARTS, length=False), commands=LEAST),
    Document(frame=packet(PLAIN_PARTS), kind="host", commands=LEAST),
)


@cache
def c_words() -> list[str]:
    """Words used by C, its library or a header."""
    known = {*words.C_KEYWORDS, *words.USUAL, *words.macros("gcc")}
    return words.names(known | words.of_generated(NEUTRAL, ["c"]))


@cache
def python_words() -> list[str]:
    """Words used by Python or a generated module."""
    known = words.of_python() | words.of_generated(NEUTRAL, ["python", "bus", "construct"])
    return words.names(known | set(words.USUAL))


@cache
def kit_words() -> list[str]:
    """Words used by a conformance kit in addition to its header."""
    known = words.of_generated(NEUTRAL, ["conformance"]) - words.of_generated(NEUTRAL, ["c"])
    return words.names(known | set(words.USUAL))


@cache
def every_word() -> list[str]:
    return sorted({*c_words(), *python_words()})


def types_of(known: Sequence[str]) -> list[str]:
    """The words that are not types of the schema language."""
    return [word for word in known if word not in BUILT_IN and not INTEGER.fullmatch(word)]


def dealt(known: Sequence[str], size: int) -> list[Sequence[str]]:
    """The words in groups of at most so many; no group has a word and the name of its size or count."""
    for groups in range(-(-len(known) // size), len(known) + 1):
        found = [known[index::groups] for index in range(groups)]
        if not any(
            f"{word}{end}" in group for group in found for word in group for end in ("_size", "_count")
        ):
            return found
    raise AssertionError("one group each has no clash")


def runs(names: Sequence[str]) -> Mapping[str, Json]:
    """Fields of variable size, each a byte string or an array with its count."""
    counts = {f"zz{index}": {"type": "u8", "counts": name} for index, name in enumerate(names)}
    return {
        **counts,
        **{name: "bytes[0..3]" if index % 2 else "u16[0..2]" for index, name in enumerate(names)},
    }


def many(name: str, known: Sequence[str]) -> Document:
    """All words as the names of one kind."""
    types = types_of(known)
    match name:
        case "of_fields":
            groups = enumerate(dealt(known, 90))
            commands = {f"zz{index}": (dict.fromkeys(group, "u8"), runs(group)) for index, group in groups}
            return Document(name, commands=commands)
        case "of_bits":
            groups = enumerate(dealt(known, 60))
            carriers: Commands = {f"zz{index}": ({"yy": bits(group)}, {}) for index, group in groups}
            return Document(name, commands=carriers)
        case "of_enums":
            return Document(name, enums=dict.fromkeys(types, ("mm", "nn")), commands=used(types))
        case "of_members":
            return Document(name, enums={"ee": known}, commands=used(["ee"]))
        case "of_flags":
            return Document(name, flags=dict.fromkeys(types, ("mm",)), commands=used(types))
        case "of_bit_names":
            flags = {f"ff{index}": group for index, group in enumerate(dealt(known, 60))}
            return Document(name, flags=flags, commands=used(list(flags)))
        case "of_types":
            return Document(name, types=types, commands=used(types))
        case "of_commands":
            return Document(name, commands=dict.fromkeys(known, LEAST["zz"]))
        case "of_messages":
            return Document(name, messages={word: {"qq": "u8"} for word in known})
        case _:
            assert name == "of_all"
            messages = {word: {word: word} for word in types}
            return Document(name, enums=dict.fromkeys(types, ("mm",)), messages=messages)


def bits(names: Sequence[str]) -> Json:
    """An integer with a bit for each name."""
    return {"type": "u64", "bits": {word: {"at": at} for at, word in enumerate(names)}}


def used(types: Sequence[str]) -> Commands:
    """Commands with a field of each type."""
    groups = [types[index : index + 100] for index in range(0, len(types), 100)]
    return {
        f"zz{index}": ({f"qq{place}": name for place, name in enumerate(group)}, {})
        for index, group in enumerate(groups)
    }


def alone(known: Sequence[str], shapes: int) -> Iterator[Document]:
    """Every word as the name of each part of a frame, in several shapes of frames."""
    for index in range(len(known)):
        six = [known[(index + 97 * step) % len(known)] for step in range(6)]
        for shape in range(index, index + shapes):
            check = "sum16" if shape % 3 else "crc-16/modbus"
            made = frame(six, stuffed=shape % 3 == 1, length=shape % 3 < 2, check=check)
            yield Document(f"parts_{index}_{shape % 3}", frame=made, commands=LEAST)


MANY = (
    "of_fields",
    "of_bits",
    "of_enums",
    "of_members",
    "of_bit_names",
    "of_flags",
    "of_types",
    "of_commands",
    "of_messages",
    "of_all",
)


def test_there_are_many_words() -> None:
    assert len(every_word()) > 800
    assert {"int", "class", "uint8_t", "stdin", "payload", "from_bytes", "capacity"} <= {*every_word()}


@pytest.mark.parametrize("compiler", COMPILERS)
def test_headers_are_clean(
    compiler: str, tmp_path: Path, shared: Path, require_tool: Callable[..., str]
) -> None:
    """All headers in one file: names of different protocols do not clash."""
    program = require_tool(compiler, package=compiler)
    folder = shared / "headers of words"
    with made_once(folder) as first:
        if first:
            for name in MANY:
                written(many(name, c_words()), "c", folder)
    paths = sorted(folder.glob("*.h"))
    if compiler == "gcc":
        usual = [Document(word, commands=LEAST) for word in words.names(words.USUAL)]
        names = [name for each in [*alone(c_words(), 3), *usual] for name in written(each, "c", tmp_path)]
        paths += [tmp_path / name for name in names]
    (tmp_path / "all.c").write_text("".join(f'#include "{path}"\n' for path in paths), "utf-8")
    language = "c++" if compiler == "g++" else "c"
    command = [program, "-x", language, *COMPILERS[compiler], *STRICT, "all.c"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr[:4000]


@pytest.mark.parametrize("name", MANY)
def test_kits_compile(name: str, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    document = many(name, kit_words())
    written(document, "c", tmp_path)
    command = [require_tool("gcc", package="gcc"), "-std=c99", *STRICT, "-DCONFORMANCE_STDIO=1"]
    command += written(document, "conformance", tmp_path)
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr[:4000]


@pytest.mark.slow
@pytest.mark.parametrize("name", MANY)
def test_python_and_construct_agree_with_the_plan(name: str) -> None:
    agree(many(name, python_words()).protocol())


@pytest.mark.slow
def test_python_and_construct_take_every_name_of_a_part() -> None:
    for each in alone(python_words(), 1):
        agree(each.protocol())


def test_modules_can_be_called_so(tmp_path: Path) -> None:
    """Modules of a package are named like protocols, even if the name is a keyword or that of a module."""
    taken = [*keyword.kwlist, *words.names(sys.stdlib_module_names)]
    known = [word for word in words.names([*taken, *words.USUAL]) if len(word) <= 20]
    modules = []
    for word in known:
        protocol = Document(word, commands=LEAST).protocol()
        for target in ("python", "bus"):
            files = saved(protocol, target, tmp_path / "wire")
            modules += [Path(each).stem for each in files if each.endswith(".py")]
    program = "".join(f"import wire.{name}\n" for name in sorted(set(modules)))
    command = [sys.executable, "-W", "error", "-c", program]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=300)


def written(document: Document, target: str, folder: Path) -> list[str]:
    """Write the files of a target to one folder; returns their names."""
    return saved(document.protocol(), target, folder)


def saved(protocol: Protocol, target: str, folder: Path) -> list[str]:
    """Write the files of a target for a protocol that has been read; returns their names."""
    folder.mkdir(exist_ok=True)
    made = TARGETS[target].load()(protocol, Options())
    for path, text in made.items():
        (folder / Path(path).name).write_text(text, "utf-8")
    return [Path(path).name for path in made]


def agree(protocol: Protocol) -> None:
    """Random values of every message give the same frame in Python and construct, and calls accept them."""
    module, live, codec = python.load(protocol), construct.live(protocol), Codec(plan_of(protocol))
    loaded(protocol, module)
    for text in construct.generate(protocol, Options()).values():
        compiles(text)
    address, requests = protocol.address_name, dict[str, bytes]()
    for message in codec.plan.messages:
        raw = choice.random(Chance(message.name)).values(message.payload)
        values = {value.name: native_of(value, raw[value.name]) for value in message.message.values}
        request = requests.get(message.message.command, b"") if codec.plan.frame.needs_request else b""
        place = {} if address is None else {address: message.message.default_address}
        wire = codec.encode(message.name, raw, request=request)
        requests[message.message.command] = wire
        made = module.MESSAGES[message.name](
            **{naming.attribute(name): value for name, value in values.items()},
            **{naming.address_attribute(name): value for name, value in place.items()},
        )
        direction = codec.plan.direction_of(message)
        asked = [module.decode_request(request)] if request else []
        assert made.to_frame(*asked) == wire
        assert getattr(module, f"decode_{direction}")(wire, *asked) == made
        parsed = live.parse(direction, wire, request)
        assert {name: plain_numbers(parsed["fields"])[name] for name in values} == values
        assert {naming.record_key(name): parsed[naming.record_key(name)] for name in place} == {
            naming.record_key(name): value for name, value in place.items()
        }
        assert parsed["message"] == message.name


@cache
def compiles(text: str) -> None:
    """Compile a module; one that is the same for all protocols is compiled once."""
    compile(text, "<generated>", "exec")


def native_of(value: Value, raw: Raw) -> object:
    """The Python value of a raw value."""
    if isinstance(value.type, Scalar):
        assert isinstance(raw, int)
        return native_from_raw(value.type, raw)
    if isinstance(value.type, Blob) and value.type.text:
        assert isinstance(raw, bytes)
        return raw.decode("ascii")
    return raw
