"""Dialects of MAVLink: against those of pymavlink, and with everything that can be wrong."""

from __future__ import annotations

import importlib
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qlinkgen.backends.c import generate
from qlinkgen.errors import ImportFileError
from qlinkgen.importers.document import Constants, Document, Field, Message, Notation
from qlinkgen.importers.mavlink import read_mavlink
from qlinkgen.importers.names import schema_name
from qlinkgen.importers.notes import Notes
from qlinkgen.importers.yaml_text import write
from qlinkgen.plan import Options
from tests.importers import dialects
from tests.importers.dialects import Version, compare
from tests.support.cdriver import WARNINGS

DIALECT = """\
<?xml version="1.0"?>
<mavlink>
  <include>{include}</include>
  <version>3</version>
  <enums>
    <enum name="MAV_MODE">
      <description>A mode.</description>
      <entry value="0" name="MAV_MODE_OFF"><description>Nothing: # at all</description></entry>
      <entry name="MAV_MODE_ON"><deprecated since="2020-01" replaced_by="X">Why.</deprecated></entry>
      <entry value="0x10" name="MAV_MODE_BIG"><wip/></entry>
      <entry value="2**3" name="MAV_MODE_EIGHT"/>
      <entry value="300" name="MAV_MODE_LONG"/>
      <entry value="0" name="MAV_MODE_AGAIN"/>
      <entry value="x" name="MAV_MODE_X"/>
    </enum>
    <enum name="MAV_FLAGS" bitmask="true">
      <entry value="1" name="MAV_FLAGS_A"/>
      <entry value="4" name="MAV_FLAGS_B"/>
      <entry value="6" name="MAV_FLAGS_AB"/>
    </enum>
    <enum name="UNUSED"><entry value="1" name="U"/></enum>
  </enums>
  <messages>
    <message id="7" name="THE_STATE">
      <description>State
        of all.</description>
      <field type="uint8_t" name="a" enum="MAV_MODE">Mode</field>
      <field type="uint16_t" name="b" units="cm/s" multiplier="1E-2" invalid="UINT16_MAX">Speed</field>
      <field type="float[3]" name="c">Three</field>
      <field type="char[16]" name="d">Name</field>
      <field type="uint8_t[4]" name="e"/>
      <field type="uint64_t" name="f"/>
      <field type="uint8_t_mavlink_version" name="version"/>
      <field type="uint16_t" name="g" enum="MAV_MODE"/>
      <field type="uint16_t" name="h" enum="MAV_FLAGS"/>
      <extensions/>
      <field type="uint32_t" name="later">Extension</field>
    </message>
    <message id="70000" name="FAR"><field type="float" name="x" enum="MAV_MODE"/></message>
    {messages}
  </messages>
</mavlink>
"""


def read(folder: Path, text: str | bytes, **options: Any) -> tuple[Document, list[str]]:
    file = folder / "dialect.xml"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    notes = Notes("dialect.xml")
    document = read_mavlink(file, notes, **options)
    return document, [str(each).replace(f"{folder}/", "") for each in sorted(notes.found)]


def dialect(include: str = "dialect.xml", messages: str = "") -> str:
    return DIALECT.format(include=include, messages=messages)


def messages(document: Document) -> dict[str, Message]:
    found = document.sections["messages"]
    return {each.name: each for each in found if isinstance(each, Message)}


def test_a_dialect(tmp_path: Path) -> None:
    document, notes = read(tmp_path, dialect())
    state = messages(document)["the_state"]
    assert [(each.name, each.type) for each in state.fields] == [
        ("f", "u64"), ("c", "f32[3]"), ("b", "u16"), ("g", "mav_mode"), ("h", "mav_flags"),
        ("a", "mav_mode_u8"), ("d", "text[16]"), ("e", "bytes[4]"), ("version", "u8"), ("later", "u32"),
    ]  # fmt: skip
    by_name = {each.name: each for each in state.fields}
    assert by_name["b"].keys == {"scale": Notation("1/100"), "unit": "cm/s"}
    assert by_name["b"].doc == "Speed Invalid: UINT16_MAX."
    assert by_name["version"].keys == {"const": 3}
    assert state.doc == "State of all."
    assert document.protocol == {
        "name": "dialect", "title": "MAVLink 2, dialect dialect", "revision": "3", "source": "dialect.xml",
    }  # fmt: skip
    assert notes == [
        "dialect.xml: note: enums of no field are left out: UNUSED",
        "dialect.xml:12: note: MAV_MODE_LONG is left out: it does not fit 8 bits",
        "dialect.xml:13: note: MAV_MODE_AGAIN is left out: its number has a name already",
        "dialect.xml:14: note: an entry of MAV_MODE is left out: its value is 'x'",
        "dialect.xml:19: note: MAV_FLAGS_AB is left out: it is not one bit",
        "dialect.xml:39: note: the enum MAV_MODE is left out: x is not an integer",
    ]


def test_enums(tmp_path: Path) -> None:
    document, _ = read(tmp_path, dialect())
    wide, small = (each for each in document.sections["enums"] if isinstance(each, Constants))
    assert [(each.name, each.value) for each in small.values] == [
        ("off", 0),
        ("on", 1),
        ("big", 16),
        ("eight", 8),
    ]
    assert [each.doc for each in small.values] == [
        "Nothing: # at all", "Deprecated since 2020-01, replaced by X. Why.", "Work in progress.", "",
    ]  # fmt: skip
    assert (small.doc, wide.values[-1].value) == ("A mode.", 300)
    (flags,) = (each for each in document.sections["flags"] if isinstance(each, Constants))
    assert [(each.name, each.value) for each in flags.values] == [("a", 0), ("b", 2)]


def test_version_1(tmp_path: Path) -> None:
    document, notes = read(tmp_path, dialect(), version=1, name="other")
    assert list(messages(document)) == ["the_state"]
    assert [each.name for each in messages(document)["the_state"].fields][-1] == "version"
    assert "dialect.xml: note: messages with ids above 255 need MAVLink 2 and are left out: FAR" in notes
    frame = write(document).text.partition("frame:")[2].partition("messages:")[0]
    assert "start: FE\n" in frame
    assert "incompatible" not in frame
    assert "trim" not in frame


def test_chosen_messages(tmp_path: Path) -> None:
    document, _ = read(tmp_path, dialect(), only=["FAR"])
    assert list(messages(document)) == ["far"]
    with pytest.raises(ImportFileError, match="message NEAR is not in the dialect"):
        read(tmp_path, dialect(), only=["NEAR"])


def test_includes(tmp_path: Path) -> None:
    """Files of the same folder, each once, also in a circle; entries of an enum may be in several."""
    (tmp_path / "other.xml").write_text(
        "<mavlink><include>dialect.xml</include><include>missing.xml</include><version>9</version>"
        '<enums><enum name="MAV_FLAGS"><entry name="MAV_FLAGS_C" value="8"/></enum></enums>\n'
        '<messages><message id="7" name="X"/><message id="8" name="Y">'
        '<field type="uint8_t" name="a" enum="NONE"/></message></messages></mavlink>'
    )
    document, notes = read(tmp_path, dialect("other.xml"))
    assert [*messages(document)] == ["the_state", "y", "far"]
    assert document.protocol["revision"] == "3"
    (flags,) = (each for each in document.sections["flags"] if isinstance(each, Constants))
    assert [each.name for each in flags.values] == ["a", "b", "c"]
    (missing,) = (each for each in notes if each.startswith("other.xml:1:"))
    assert "missing.xml is not included: cannot read it: No such file" in missing
    assert [each for each in notes if each.startswith("other.xml:2:")] == [
        "other.xml:2: note: message X is left out: THE_STATE has its id 7",
        "other.xml:2: note: the enum NONE is not in the dialect; the field is a number",
    ]


@pytest.mark.parametrize("include", ["../x.xml", "/etc/passwd", "a/b.xml", "..", "", "http://x/y.xml"])
def test_other_folders_are_not_read(tmp_path: Path, include: str) -> None:
    _, notes = read(tmp_path, dialect(include))
    assert f"dialect.xml:3: note: '{include}' is not included: it is not a file of the same folder" in notes


@pytest.mark.parametrize(
    ("message", "note"),
    [
        (
            '<message id="1" name="M"><field type="banana" name="x"/></message>',
            "the type of field 'x' is 'banana'",
        ),
        ('<message id="1" name="M"><field type="uint8_t[9999]" name="x"/></message>', "is 'uint8_t[9999]'"),
        ('<message id="1" name="M"><field type="uint8_t"/></message>', "the type of field '' is 'uint8_t'"),
        ('<message id="x" name="M"/>', "message 'M' is left out: it needs a name and an id of 24 bits"),
        ('<message id="99999999" name="M"/>', "it needs a name and an id of 24 bits"),
        ('<message id="1"/>', "it needs a name and an id of 24 bits"),
        (
            '<message id="1" name="M"><field type="uint8_t" name="x" multiplier="0"/></message>',
            "multiplier '0' is not",
        ),
        ('<message id="1" name="the-state"/>', "message 'THE_STATE' is called the_state_2"),
    ],
)
def test_notes(tmp_path: Path, message: str, note: str) -> None:
    _, notes = read(tmp_path, dialect(messages=message))
    assert any(
        each.startswith(("dialect.xml:40: note:", "dialect.xml:24: note:")) and note in each for each in notes
    ), notes


LAUGHS = """\
<?xml version="1.0"?>
<!DOCTYPE lolz [<!ENTITY lol "lol"><!ENTITY lol2 "&lol;&lol;&lol;&lol;&lol;&lol;&lol;&lol;&lol;">]>
<mavlink>&lol2;</mavlink>
"""


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("", "dialect.xml:1: this is not XML: no element found"),
        ("<mavlink>\n<a>", "dialect.xml:2: this is not XML"),
        ("<mavlink>\n</b>", "dialect.xml:2: this is not XML: mismatched tag"),
        ("<mavlink>&x;</mavlink>", "this is not XML: undefined entity"),
        (LAUGHS, "dialect.xml:2: a document type declaration is refused"),
        ('<!DOCTYPE a SYSTEM "file:///etc/passwd"><mavlink/>', "a document type declaration is refused"),
        ("\n<html/>", "dialect.xml:2: the root is <html>, not <mavlink>"),
        ("<mavlink>" + "<a>" * 40, "elements are nested more than 30 deep"),
        ('<?xml version="1.0" encoding="utf-7"?><mavlink/>', "the encoding of this XML cannot be read"),
        ('<?xml version="1.0" encoding="banana"?><mavlink/>', "cannot be read: unknown encoding"),
        (b"\x89PNG\r\n", "this is not XML"),
        (b"<mavlink>\xff</mavlink>", "this is not XML"),
    ],
)
def test_errors(tmp_path: Path, text: str | bytes, error: str) -> None:
    with pytest.raises(ImportFileError) as caught:
        read(tmp_path, text)
    assert error in str(caught.value)


def test_too_many_files(tmp_path: Path) -> None:
    for number in range(60):
        (tmp_path / f"{number}.xml").write_text(f"<mavlink><include>{number + 1}.xml</include></mavlink>")
    with pytest.raises(ImportFileError, match="more than 50 files"):
        read(tmp_path, dialect("0.xml"))


PIECES = """<mavlink> </mavlink> <enums> </enums> <messages> </messages> <message </message> <field </field>
    <enum <entry </entry> </enum> id="1" id="70000" name="A" name="a" name="b" type="uint8_t" type="float[3]"
    type="char[9]" > /> value="1" value="0" enum="A" bitmask="true" <extensions/> <include> </include>
    dialect.xml <version> 3 </version> <!-- --> <![CDATA[ ]]> &lt;
    <description> </description> é units="m" 2**70"""


@given(text=st.lists(st.sampled_from(PIECES.split()), max_size=50).map(" ".join))
def test_any_pieces(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    for form in (text, f"<mavlink>{text}</mavlink>"):
        try:
            document, _ = read(tmp_path_factory.getbasetemp(), form)
        except ImportFileError:
            continue
        write(document)


@given(at=st.integers(0, len(DIALECT)), width=st.integers(0, 9), put=st.text(max_size=4))
def test_a_mutated_dialect(tmp_path_factory: pytest.TempPathFactory, at: int, width: int, put: str) -> None:
    text = dialect()[:at] + put + dialect()[at + width :]
    try:
        document, _ = read(tmp_path_factory.getbasetemp(), text.encode("utf-8", "replace"))
    except ImportFileError:
        return
    write(document)


# pymavlink -----------------------------------------------------------------------------------------------

LETTERS = dict(
    zip(("u8", "i8", "u16", "i16", "u32", "i32", "u64", "i64", "f32", "f64"), "BbHhIiQqfd", strict=True)
)


#: Everything that a header has.
DEFINED = ("-DARDUPILOTMEGA_ENABLE_FLOAT=1", "-DARDUPILOTMEGA_ENABLE_NAMES=1")


def of_pymavlink(name: str, version: str) -> tuple[Path, Mapping[int, Any]]:
    reason = "needs pymavlink (pip install pymavlink)"
    module = pytest.importorskip(f"pymavlink.dialects.{version}.{name}", reason=reason)
    folder = Path(importlib.import_module("pymavlink").__file__ or "").parent
    return folder / "dialects" / version / f"{name}.xml", module.mavlink_map


@pytest.mark.slow
@pytest.mark.parametrize(("name", "version"), [("ardupilotmega", 2), ("common", 1), ("storm32", 2)])
def test_definitions_are_those_of_pymavlink(name: str, version: Any) -> None:
    """Ids, seeds, order and number of items of every message of a dialect."""
    file, theirs = of_pymavlink(name, f"v{version}0")
    document = read_mavlink(file, Notes("x"), version=version)
    ours = {each.keys["id"]: each for each in messages(document).values()}
    assert set(ours) == set(theirs)
    for number, message in theirs.items():
        own = ours[number]
        assert own.name == message.msgname.lower()
        assert own.keys["attributes"] == {"crc_extra": message.crc_extra}
        assert [each.name for each in own.fields] == [
            schema_name(each) for each in message.ordered_fieldnames
        ]
        assert "<" + "".join(code(each, document) for each in own.fields) == message.unpacker.format


@pytest.mark.slow
@pytest.mark.parametrize(("name", "version"), [("common", 1), ("common", 2), ("ardupilotmega", 2)])
def test_frames_are_those_of_pymavlink(name: str, version: Version) -> None:
    """A frame of every message, both ways, and more of some; `tests.importers.dialects` has more."""
    pytest.importorskip("pymavlink", reason="needs pymavlink (pip install pymavlink)")
    found = dialects.dialect(name, version)
    for message in found.model.messages:
        compare(found, message, Random(message.name))
    for message in Random(name).sample(found.model.messages, 20):
        for seed in range(20):
            compare(found, message, Random(seed))


@pytest.mark.slow
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_a_dialect_compiles_without_warnings(
    tmp_path: Path, compiler: str, require_tool: Callable[..., str]
) -> None:
    pytest.importorskip("pymavlink", reason="needs pymavlink (pip install pymavlink)")
    model, _ = dialects.imported("ardupilotmega", 2)
    (header,) = generate(model, Options()).values()
    (tmp_path / "dialect.h").write_text(header)
    source = tmp_path / "dialect.c"
    source.write_text('#include "dialect.h"\n')
    command = [require_tool(compiler, package=compiler), "-std=c99", "-fsyntax-only", *WARNINGS, *DEFINED]
    done = subprocess.run([*command, source], capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert done.stderr == ""


@pytest.mark.slow
def test_generation_grows_with_the_number_of_messages() -> None:
    pytest.importorskip("pymavlink", reason="needs pymavlink (pip install pymavlink)")
    _, (half, before), (whole, after) = dialects.shares("common", 2, dialects.steps)
    assert after / before < 1.1 * whole / half


def code(field: Field, document: Document) -> str:
    """The format of a field in the module struct."""
    base, _, count = field.type.rstrip("]").partition("[")
    constants = (*document.sections["enums"], *document.sections["flags"])
    types = {each.name: each.type for each in constants if isinstance(each, Constants)}
    letter = {"text": "s", "bytes": "B", **LETTERS}[types.get(base, base)]
    return f"{count}{letter}" if count not in ("", "1") or letter == "s" else letter
