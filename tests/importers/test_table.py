"""Tables of fields: headings, types, places, values, and what is left out."""

from __future__ import annotations

import csv
import io
import zipfile
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from openpyxl import Workbook

from qlinkgen.importers import cells
from qlinkgen.importers.table import KEYS, Options, read_csv, read_xlsx
from qlinkgen.importers.table.kinds import kind
from tests.importers.conftest import Import, Imported, refused, survives

TABLE = """\
Tank bus v1.2
Message,Msg ID,Byte,Field,Data type,Scale,Unit,Min,Max,Values,Description,Owner
set_pump,0x10,0,Mode,uint8,,,,,"0=stopped, 1=filling, 2=emptying",What to do,bob
,,1,Speed,u16,0.1,rpm,0,3000,,Speed of the motor,
,,5,Flags,byte,,,,,,State of the motor,
,,5.0,Running,,,,,,,Pump runs,
,,5.1,Fault,,,,,,,,
get_level,0x11,0,Level,int16 LE,0.01,m,-300,300,,Above the sensor,
,,2,MAC,uint8[6],,,,,,,
,,8,temp,float,,°C,-40,85,,,
,,12,x,foo,,,,,,,
"""

SCHEMA = """\
qlinkgen: 1
protocol: {name: tank, revision: "", source: tank.csv}
byteorder: big

enums:
  mode: {type: u8, values: {stopped: 0, filling: 1, emptying: 2}}

# A table does not describe the frame. These parts are an assumption: replace them by those of the protocol,
# then remove `confirmed: false`.
frame:
  confirmed: false
  parts:
    number: {role: message, type: u8}
    length: {type: u8, counts: [data]}
    data: {role: payload, size: 0..12}

bus: {kind: master_slave}

messages:
  set_pump:
    id: 0x10
    fields:
      mode: {type: mode, doc: What to do}
      speed: {type: u16, scale: 1/10, unit: rpm, range: 0..3000, doc: Speed of the motor}
      gap: {type: u16, reserved: true}
      flags: {type: u8, bits: {running: {at: 0, doc: Pump runs}, fault: 1}, doc: State of the motor}
  get_level:
    id: 0x11
    fields:
      level: {type: i16, byteorder: little, scale: 1/100, unit: m, range: -300..300, doc: Above the sensor}
      mac: bytes[6]
      temp: {type: f32, unit: °C, range: -40..85}
"""

NOTES = """\
2: note: column 'Owner' is ignored; --map 'Owner=KEY' says what it states
5: note: 2 bytes before 'Flags' are not described: reserved
11: note: field 'x' is left out: the type 'foo' is not known
"""


def test_a_table(imported: Import) -> None:
    found = imported(read_csv, TABLE, "tank.csv")
    assert found.text == SCHEMA
    assert found.notes == NOTES.splitlines()


@pytest.mark.parametrize("delimiter", [";", "\t", "|"])
def test_other_delimiters(imported: Import, delimiter: str) -> None:
    text = io.StringIO()
    csv.writer(text, delimiter=delimiter).writerows(csv.reader(io.StringIO(TABLE)))
    assert imported(read_csv, text.getvalue(), "tank.csv").text == SCHEMA


def rows(imported: Import, heading: str, *lines: str, options: Options | None = None) -> Imported:
    text = "\n".join((heading, *lines))
    return imported(lambda path, notes: read_csv(path, notes, options), text, "m.csv")


def fields(found: Imported) -> str:
    """Names and types, or the long form without names of keys."""
    fields = found.part("messages", "m", "fields")
    assert isinstance(fields, dict)
    return ", ".join(
        f"{name} {each}" if isinstance(each, str) else f"{name} {' '.join(map(str, each.values()))}"  # type: ignore[union-attr]
        for name, each in fields.items()
    )


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ("a,UINT16,;b,unsigned int,4;c,,3;d,S8,;e,signed,2", "a u16, b u32, c u24, d i8, e i16"),
        ("a,WORD,;b,DINT,;c,UDINT,;d,Boolean,", "a u16, b i32, c u32, d bool"),
        ("a,u16,32;b,u32,32;c,u8,4", "a u16[16], b u32, c bytes[4]"),
        ("a,u16,16 bit;b,string,20;c,char(3),;d,raw,", "a u16, b text[20] 00, c text[3] 00, d bytes"),
        ("a,u16[3],6;b,uint8[],", "a u16[3], b bytes"),
        ("a,,12;b,double,", "a bytes[12], b f64"),
        ("reserved,u8,;Spare 2,,11", "reserved u8 True, spare_2 u64 True, spare_2_2 u24 True"),
    ],
)
def test_types_and_sizes(imported: Import, lines: str, expected: str) -> None:
    assert fields(rows(imported, "name,type,size", *lines.split(";"))) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("u16", ("u", 2, None, "")),
        ("UINT_16", ("u", 2, None, "")),
        ("int 32 bit", ("i", 4, None, "")),
        ("uint16_t", ("u", 2, None, "")),
        ("u16le", ("u", 2, None, "little")),
        ("Float32", ("f", 4, None, "")),
        ("u24 x 3", ("u", 3, 3, "")),
        ("char[n]", ("text", 1, 0, "")),
        ("enum", ("u", 0, None, "")),
        ("", ("u", 0, None, "")),
    ],
)
def test_a_type(text: str, expected: tuple[object, ...]) -> None:
    found = kind(text)
    assert found is not None
    assert (found.base, found.size, found.count, found.order) == expected


def test_places(imported: Import) -> None:
    found = rows(imported, "name,type,offset", "b,u16,0x03", "a,u8,1", "c,u8,3", "d,u8,9", "e,u8,8")
    assert fields(found) == "a u8, gap u8 True, b u16, gap_2 u24 True, e u8, d u8"
    assert found.notes == [
        "2: note: 1 byte before 'b' is not described: reserved",
        "3: note: offsets begin with 1: this is the first byte of the payload",
        "4: note: field 'c' is left out: offset 3 lies inside the fields before it, which end at 5",
        "6: note: 3 bytes before 'e' are not described: reserved",
    ]


def test_offsets_with_ranges(imported: Import) -> None:
    assert (
        fields(rows(imported, "name,byte", "a,0", "b,1-4", "c,5..6", "d,7 to 9"))
        == "a u8, b u32, c u16, d u24"
    )


def bits(imported: Import, heading: str, *lines: str) -> list[object]:
    found = rows(imported, heading, *lines).part("messages", "m", "fields")
    assert isinstance(found, dict)
    return [each["bits"] if isinstance(each, dict) and "bits" in each else each for each in found.values()]


@pytest.mark.parametrize(
    ("heading", "lines", "expected"),
    [
        ("name,type,bit", "a,u16,;b,,0;c,,7:4;d,,bit 15;e,u8,", [{"b": 0, "c": "4..7", "d": 15}, "u8"]),
        ("name,byte,bit", "b,0,0;c,0,1..7;d,1,3", [{"b": 0, "c": "1..7"}, {"d": 3}]),
        ("name,byte,bit", "b,0,0;reserved,0,7", [{"b": 0}]),
        ("name,byte,type", "b,0.0,;c,0.7,;d,1,u8", [{"b": 0, "c": 7}, "u8"]),
        ("name,bit offset,size [bits]", "b,0,1;c,1,3;d,8,16", [{"b": 0, "c": "1..3"}, "u16"]),
        ("name,bit,values", '"a","0-1","0=low, 1=high"', [{"a": {"at": "0..1", "type": "a"}}]),
        ("name,bit,scale", "a,0-7,0.1", [{"a": {"at": "0..7", "scale": "1/10"}}]),
        ("name,bit,unit,max", "a,0-7,V,20", [{"a": {"at": "0..7", "unit": "V", "range": "0..20"}}]),
        ("name,bit,values,doc", "a,0,0=off,d", [{"a": {"at": 0, "doc": "d (0=off)"}}]),
    ],
)  # fmt: skip
def test_bits(imported: Import, heading: str, lines: str, expected: list[object]) -> None:
    assert bits(imported, heading, *lines.split(";")) == expected


def test_messages_and_commands(imported: Import) -> None:
    found = rows(
        imported,
        "command,id,direction,name,type",
        "Get level,0x20,request,tank,u8",
        ",,response,level,u16",
        "alarm,,response,kind,u8",
        "reset,33,request,-,",
        "stop,5,to me,x,u8",
        "split,6,request,x,u8",
        "split,7,response,y,u8",
    )
    assert found.part("commands") == {
        "get_level": {
            "id": 0x20, "repeat": "unsafe", "request": {"tank": "u8"}, "response": {"level": "u16"},
        },
        "split": {
            "id": 6, "repeat": "unsafe", "request": {"x": "u8"}, "response": {"id": 7, "fields": {"y": "u8"}},
        },
    }  # fmt: skip
    assert found.part("messages", "reset") == {"id": 33, "direction": "request", "fields": {}}
    assert found.part("messages", "alarm") == {
        "id": 34, "confirmed": False, "direction": "response", "fields": {"kind": "u8"},
    }  # fmt: skip
    assert "Message ids are numbered" in found.text
    assert found.notes == ["6: note: direction 'to me' is ignored: only request and response are known"]


def test_messages_by_number_or_by_file(imported: Import) -> None:
    found = rows(imported, "id,name,type", "1,a,u8", ",b,u8", "2,a,u8")
    assert found.part("messages") == {
        "message_1": {"id": 1, "fields": {"a": "u8", "b": "u8"}},
        "message_2": {"id": 2, "fields": {"a": "u8"}},
    }
    assert rows(imported, "name,type", "a,u8").part("messages", "m", "confirmed") is False


def test_a_line_for_the_message_itself(imported: Import) -> None:
    found = rows(imported, "message,id,name,type,doc", "go,1,,,Moves on", ",,a,u8,")
    assert found.part("messages", "go") == {"id": 1, "doc": "Moves on", "fields": {"a": "u8"}}


def test_columns_that_the_user_names(imported: Import) -> None:
    options = Options("other", "little", {"Len (B)": "size", "Owner": "", "Art": "type"})
    found = rows(imported, "name,Art,Len (B),Owner", "a,unsigned,2,bob", options=options)
    assert found.part("protocol", "name") == "other"
    assert found.part("byteorder") == "little"
    assert fields(found) == "a u16"
    assert found.notes == []


def test_the_usual_byte_order_is_that_of_the_schema(imported: Import) -> None:
    found = rows(imported, "name,type,endian", "a,u16,Intel", "b,u16,little", "c,u16,MSB first")
    assert found.part("byteorder") == "little"
    assert fields(found) == "a u16, b u16, c u16 big"


@pytest.mark.parametrize(
    ("heading", "line", "expected"),
    [
        ("scale", "x10", "a i16 10"),
        ("scale", '"0,25"', "a i16 1/4"),
        ("resolution", "1/8 deg", "a i16 1/8"),
        ("factor", "10^-3", "a i16 1/1000"),
        ("factor", "2/3", "a i16 2/3"),
        ("lsb", "1", "a i16"),
        ("scale", "1e-2", "a i16 1/100"),
        ("bias", "-40", "a i16 -40"),
        ("unit", "n/a", "a i16"),
        ("range", "0-100", "a i16 0..100"),
        ("range", '"[-5, 5]"', "a i16 -5..5"),
        ("range", "-40…85", "a i16 -40..85"),
        ("min", "0", "a i16 0..32767"),
        ("max", "0x10", "a i16 -32768..16"),
        ("range", "-32768..32767", "a i16"),
        ("default", "7", "a i16 7"),
        ("default", "0x0A", "a i16 10"),
        ("const", "5", "a i16 5"),
        ("default", "-", "a i16"),
        ("section", "7.1", "a i16 7.1"),
        ("description", "Say: #this", "a i16 Say: #this"),
    ],
)
def test_values(imported: Import, heading: str, line: str, expected: str) -> None:
    assert fields(rows(imported, f"name,type,{heading}", f"a,i16,{line}")) == expected


def test_scaled_values(imported: Import) -> None:
    heading = "name,type,scale,byte,offset,min,max,default"
    found = rows(imported, heading, "a,u8,0.5,0,-40,-40,60,20.5", "b,u8,0.5,1,,0.3,9,0.3")
    assert fields(found) == "a u8 1/2 -40 -40..60 20.5, b u8 1/2"
    assert [each for each in found.notes if "left out" in each] == [
        "3: note: default '0.3' is left out: not a value of this field",
        "3: note: range 0.3..9 is left out: the field cannot have these values exactly",
    ]


def test_enums(imported: Import) -> None:
    found = rows(
        imported,
        "message,name,type,values,default",
        'x,mode,u8,"0: Off\n1: Heating up (slow) | 0x2 - n/a",Off',
        'y,mode,u8,"0=Off, 1=Heating up (slow), 2=n/a",1',
        'y,level,u8,"0=a,1=A,1=b,300=c",',
        "y,bad,u8,see below,",
        'z,mode,u16,"0=Off",',
    )
    assert found.part("enums") == {
        "mode": {
            "type": "u8",
            "values": {"off": 0, "heating_up_slow": 1, "n_a": 2},
        },
        "z_mode": {"type": "u16", "values": {"off": 0}},
        "level": {"type": "u8", "values": {"a": 0, "a_2": {"value": 1, "doc": "A"}}},
    }  # fmt: skip
    assert found.part("messages", "x", "fields", "mode") == {"type": "mode", "default": 0}
    assert found.part("messages", "z", "fields", "mode") == "z_mode"


@pytest.mark.parametrize(
    ("heading", "line", "note"),
    [
        ("type", "banana", "field 'a' is left out: the type 'banana' is not known"),
        ("type", "unsigned", "field 'a' is left out: its size is not stated"),
        ("type,size", "u16,3", "its type has 2 bytes, its size is 3"),
        ("type,count,size", "u16,3,5", "3 items of 2 bytes are not 5 bytes"),
        ("type,count,size", "unsigned,3,5", "5 bytes are not a multiple of 3 items"),
        ("type,count", "u16,60000", "120000 bytes are more than a payload can have"),
        ("type,scale", "u8,zero", "scale 'zero' is not a number"),
        ("type,scale", "u8,0", "scale '0' is not a number"),
        ("type,scale", "text[4],2", "scale 2 is left out: text[4] has none"),
        ("type,range", "u8,all", "range 'all' is not understood"),
        ("type,range", "u8,0..500", "range 0..500 is left out"),
        ("type,min", "u8,low", "min 'low' is not a number"),
        ("type,min,max", "u8,5,1", "min is greater than max"),
        ("type,default", "u8,many", "default 'many' is left out"),
        ("type,default", "u8,256", "default '256' is left out"),
        ("type,values", "u8,see below", "values 'see below' are not understood"),
        ("type,bit", "u8,64", "bit 64 is not inside 64 bits"),
        ("type,id", "u8,soon", "id 'soon' is not a number; the message is numbered"),
        ("type,Banana", "u8,1", "column 'Banana' is ignored; --map 'Banana=KEY' says what it states"),
        ("type,offset", "u8,70000000", "is the first byte of the payload"),
    ],
)
def test_notes(imported: Import, heading: str, line: str, note: str) -> None:
    """What is wrong costs the field or the key, not the table."""
    found = rows(imported, f"name,{heading}", f"a,{line}", "ok,u8")
    assert any(note in each for each in found.notes), found.notes


def test_more_than_a_frame_can_have(imported: Import) -> None:
    found = rows(imported, "name,type", "a,u8[65000]", "b,u8[600]", "c,u8")
    assert fields(found) == "a bytes[65000]"
    (note,) = found.notes
    assert note.startswith("3: note: field 'b' is left out: with it the message has more than 65535 bytes")


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("", "no row has the headings of a table"),
        ("a,b,c\n1,2,3", "no row has the headings of a table"),
        ("name,type\n", "nothing could be imported"),
        ('name,type\na,"u8', "x.csv:2: this row is not CSV"),
        (b"\x89PNG\r\n\x1a\n\0", "a byte 00: this is not a text file"),
        ("name,type\n" + "a,u8\n" * 100_001, "more than 100000 rows"),
    ],
)
def test_errors(tmp_path: Path, text: str | bytes, error: str) -> None:
    assert error in refused(tmp_path, read_csv, text, "x.csv")


# Numbers ------------------------------------------------------------------------------------------------


@given(value=st.fractions(-(10**12), 10**12, max_denominator=10**6))
def test_numbers_are_spelt_so_that_they_are_read(value: Fraction) -> None:
    assert cells.number(cells.spelt(value)) == value


@given(text=st.text(max_size=30))
def test_any_cell(text: str) -> None:
    cells.integer(text)
    cells.number(text)
    cells.bounds(text)
    cells.named_values(text)
    cells.bit_range(text)
    kind(text)


CELLS = """a u8 u16 0 1 3.1 0x10 0-3 0..100 0=a,1=b 1/10 -5 text bytes u8[3] request response big le float 1e9
    65535 n/a 8bit"""
CELL = st.one_of(st.sampled_from(["", "x" * 50, *CELLS.split()]), st.text(max_size=8))


@given(
    heading=st.lists(st.sampled_from([names[0] for names in KEYS.values()]), max_size=10, unique=True),
    lines=st.lists(st.lists(CELL, max_size=12), max_size=8),
)
def test_any_table(
    tmp_path_factory: pytest.TempPathFactory, heading: list[str], lines: list[list[str]]
) -> None:
    text = io.StringIO()
    csv.writer(text).writerows(
        [["name", "type", *(each for each in heading if each not in ("name", "type"))], *lines]
    )
    survives(tmp_path_factory.getbasetemp(), read_csv, text.getvalue().encode("utf-8", "replace"))


@given(data=st.binary(max_size=200))
def test_any_bytes(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    for read in (read_csv, read_xlsx):
        survives(tmp_path_factory.getbasetemp(), read, data)


# Workbooks ----------------------------------------------------------------------------------------------


def workbook(sheets: dict[str, list[list[object]]]) -> bytes:
    book = Workbook()
    assert book.active is not None
    book.remove(book.active)
    for title, lines in sheets.items():
        sheet = book.create_sheet(title)
        for line in lines:
            sheet.append(line)
    data = io.BytesIO()
    book.save(data)
    return data.getvalue()


def test_a_workbook(imported: Import) -> None:
    book = workbook(
        {
            "Notes": [["Version", 1.2]],
            "Set pump": [["Set pump"], [], ["Name", "Type", "Scale", "Max"], ["Speed", "u16", 0.1, 3000.0]],
            "State": [["Name", "Type", "Colour"], ["Level", "u16", "red"], ["x", "foo"]],
        }
    )
    found = imported(read_xlsx, book, "tank.xlsx")
    assert found.part("messages", "set_pump", "fields") == {
        "speed": {"type": "u16", "scale": "1/10", "range": "0..3000"}
    }
    assert found.part("messages", "state", "fields") == {"level": "u16"}
    assert found.notes == [
        "tank.xlsx[Notes]: note: this sheet is ignored: no row with the headings of a table of fields",
        "tank.xlsx[State]:1: note: column 'Colour' is ignored; --map 'Colour=KEY' says what it states",
        "tank.xlsx[State]:3: note: field 'x' is left out: the type 'foo' is not known",
    ]


def zipped(files: dict[str, bytes]) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    return data.getvalue()


LAUGHS = b'<!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "&a;&a;">]><x>&b;</x>'


@pytest.mark.parametrize(
    ("data", "error"),
    [
        (b"PK", "this is not a workbook that can be read"),
        (zipped({}), "this is not a workbook that can be read"),
        (zipped({"xl/workbook.xml": b"<a"}), "this is not a workbook that can be read"),
        (zipped({"xl/workbook.xml": LAUGHS}), "xl/workbook.xml in the workbook has a document type"),
        (zipped({"a.rels": LAUGHS.decode().encode("utf-16")}), "a.rels in the workbook has a document type"),
        (zipped({"xl/media/x": bytes(70 << 20)}), "the workbook expands to more than 64 MiB"),
        (zipped({str(n): b"" for n in range(2001)}), "the workbook expands to more than 64 MiB"),
        (workbook({"a": [["x"]]}), "no row has the headings of a table"),
    ],
)
def test_broken_workbooks(tmp_path: Path, data: bytes, error: str) -> None:
    assert error in refused(tmp_path, read_xlsx, data, "x.xlsx")


@given(at=st.integers(0, 5000), put=st.binary(min_size=1, max_size=8))
def test_mutated_workbooks(tmp_path_factory: pytest.TempPathFactory, at: int, put: bytes) -> None:
    data = bytearray(BOOK)
    at %= len(data)
    data[at : at + len(put)] = put
    survives(tmp_path_factory.getbasetemp(), read_xlsx, bytes(data), "x.xlsx")


BOOK = workbook({"m": [["Name", "Type"], ["a", "u8"]]})
