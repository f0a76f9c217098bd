"""C headers: layouts, names, comments, and what is left out."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qlinkgen.importers.header import read_header
from tests.importers.conftest import Import, refused, survives

HEADER = """\
/* Tank monitor */
#ifndef TANK_H
#define TANK_H
#include <stdint.h>
#include "config.h"
#define SAMPLES (2 * 4)
#define VERSION "1.2"
#define PACKED __attribute__((packed))
#ifdef __cplusplus
extern "C" {
#endif

/** What the pump does. */
typedef enum {
    PUMP_MODE_OFF = 0,   ///< Nothing runs
    PUMP_MODE_FILL,      ///< Fills
                         ///< the tank
    PUMP_MODE_EMPTY = 5, /* Empties: it */
    PUMP_MODE_LAST = PUMP_MODE_EMPTY,
} pump_mode_t;

/**
 * @brief State of a tank.
 */
typedef struct {
    uint8_t node;          /**< Number of the node */
    uint32_t level;        /**< Level in mm */
    // The pump runs
    uint8_t running : 1;
    uint8_t : 3;
    uint8_t gear : 4;
    pump_mode_t mode;
    uint16_t samples[SAMPLES];
    uint8_t mac[6];
} TankState;

#pragma pack(push, 1)
struct set_level { int64_t level; uint8_t reserved[3]; uint8_t class; uint8_t data[]; };
#pragma pack(pop)

struct PACKED tight { uint8_t a; int16_t b; };

struct bad { foo_t x; };
void f(struct bad *p);
static inline int g(int a) { return a; }
#ifdef __cplusplus
}
#endif
#endif
"""

SCHEMA = """\
# From tank.h. Message ids are numbered in order: replace them, then remove `confirmed: false`.
qlinkgen: 1
protocol: {name: tank, revision: "", source: tank.h}
byteorder: little

enums:
  pump_mode:
    type: u32
    doc: What the pump does.
    values:
      off: {value: 0, doc: Nothing runs}
      fill: {value: 1, doc: Fills the tank}
      empty: {value: 5, doc: "Empties: it"}

# A header does not describe the frame. These parts are an assumption: replace them by those of the protocol,
# then remove `confirmed: false`.
frame:
  confirmed: false
  parts:
    number: {role: message, type: u8}
    length: {type: u8, counts: [data]}
    data: {role: payload, size: 0..255}

bus: {kind: master_slave}

messages:
  tank_state:
    id: 1
    confirmed: false
    doc: State of a tank.
    fields:
      node: {type: u8, doc: Number of the node}
      padding: {type: u24, reserved: true}
      level: {type: u32, doc: Level in mm}
      bits_8: {type: u8, bits: {running: {at: 0, doc: The pump runs}, gear: 4..7}}
      padding_2: {type: u24, reserved: true}
      mode: pump_mode
      samples: u16[8]
      mac: bytes[6]
      padding_3: {type: u16, reserved: true}
  set_level:
    id: 2
    confirmed: false
    fields: {level: i64, reserved: {type: u24, reserved: true}, class: u8, data: bytes}
  tight:
    id: 3
    confirmed: false
    fields: {a: u8, b: i16}
"""

NOTES = """\
5: note: #include "config.h" is not read; types defined there are unknown
7: note: constant VERSION ("1.2") is left out: no structure uses it
14: note: enum pump_mode_t has 4 bytes, as without -fshort-enums
19: note: constant PUMP_MODE_LAST is left out: 5 has a name already
27: note: tank_state: 3 bytes of padding before level
32: note: tank_state: 3 bytes of padding before mode
34: note: tank_state: 2 bytes of padding after the last member
43: note: structure bad is left out: the size of foo_t is not known; use a type of stdint.h
"""


def test_a_header(imported: Import) -> None:
    found = imported(read_header, HEADER, "tank.h")
    assert found.text == SCHEMA
    assert found.notes == NOTES.splitlines()


def fields(imported: Import, text: str, note: str = "") -> object:
    found = imported(read_header, text, "x.h")
    assert not note or any(note in each for each in found.notes), found.notes
    return found.part("messages", "s", "fields")


@pytest.mark.parametrize(
    ("members", "expected"),
    [
        (
            "unsigned char a; signed char b; short c; unsigned long long d;",
            "a u8 b i8 c i16 padding u32 d u64",
        ),
        ("u8 a; __u16 b; INT32 c; WORD d, e;", "a u8 padding u8 b u16 c i32 d u16 e u16"),
        ("bool a; _Bool b;", "a bool b bool"),
        ("const volatile uint8_t a; uint_least16_t b;", "a u8 padding u8 b u16"),
        ("struct { uint8_t x, y; }; uint8_t z;", "x u8 y u8 z u8"),
        ("uint8_t a[0x4][2];", "a bytes[8]"),
        ("uint16_t motorSpeed, HTTPCode;", "motor_speed u16 http_code u16"),
        ("char a;", "a u8"),
        ("mac_t mac; uint8_t n; mac_t many[2];", "mac bytes[6] n u8 many bytes[12]"),
        ("uint16_t a; uint8_t pad0; uint8_t _reserved;", "a u16 pad0 u8 reserved u8"),
    ],
)
def test_members(imported: Import, members: str, expected: str) -> None:
    found = fields(imported, f"#include <stdint.h>\ntypedef uint8_t mac_t[6];\nstruct s {{ {members} }};")
    assert isinstance(found, dict)
    said = " ".join(
        f"{name} {each if isinstance(each, str) else each['type']}" for name, each in found.items()
    )
    assert said == expected


@pytest.mark.parametrize(
    ("members", "bits"),
    [
        ("uint8_t a:1, b:7;", {"a": 0, "b": "1..7"}),
        (
            "int16_t a:3; int16_t b:13;",
            {"a": {"at": "0..2", "signed": True}, "b": {"at": "3..15", "signed": True}},
        ),
        ("uint32_t a:3; uint32_t :0;", {"a": "0..2"}),
        ("uint8_t a:3; uint8_t :0;", {"a": "0..2"}),
    ],
)
def test_bit_fields(imported: Import, members: str, bits: object) -> None:
    found = fields(imported, f"struct s {{ {members} }};")
    assert isinstance(found, dict)
    assert found["bits_0"]["bits"] == bits


def test_bit_fields_of_a_big_endian_machine(tmp_path: Path, imported: Import) -> None:
    def read(path: Path | str, notes: object) -> object:
        return read_header(path, notes, byteorder="big")  # type: ignore[arg-type]

    found = imported(read, "struct s { uint16_t a:1, b:15; };", "x.h")  # type: ignore[arg-type]
    assert found.part("byteorder") == "big"
    assert found.part("messages", "s", "fields", "bits_0", "bits") == {"a": 15, "b": "0..14"}


@pytest.mark.parametrize(
    ("text", "line", "note"),
    [
        ("\nstruct b { int *p; };", 2, "structure b is left out: a pointer or function"),
        ("struct b {\n long x; };", 2, "the size of long is not known"),
        ("struct b {\n size_t x; };", 2, "the size of size_t is not known"),
        ("union v { int a; };\nstruct b {\n union v x; };", 3, "a union"),
        ("struct b { uint8_t n; uint16_t a:16; };", 1, "do not begin at a multiple of 2 bytes"),
        ("struct b { uint16_t a:3; uint8_t n; };", 1, "do not fill 16 bits"),
        ("struct b { uint16_t a:3; uint8_t n:5; };", 1, "bit fields of several types"),
        ("struct b { uint16_t a:9,\n c:9; };", 2, "c crosses a border of 16 bits"),
        ("struct b { uint8_t a:9; };", 1, "a bit field of 9 bits in 8 bits"),
        ("struct b { struct b x; };", 1, "a structure contains itself"),
        ("struct b { uint8_t x[]; uint8_t y; };", 1, "a member after an array without size"),
        ("struct b { uint8_t x[70000]; };", 1, "more than 65535 bytes"),
        ("struct b { uint8_t x[N]; };", 1, "the constant N is not known"),
        ("struct b { uint8_t x[-1]; };", 1, "-1 is not a size"),
        ("struct b { uint8_t x[1 << 65]; };", 1, "1 << 65 is not a constant"),
        ("struct b { uint8_t x[1 / 0]; };", 1, "1 / 0 is not a constant"),
        ("struct b { uint8_t x[099]; };", 1, "Invalid octal constant"),
        ("struct b { uint8_t x __attribute__((aligned(8))); };", 1, "aligned changes the layout"),
        ("struct b { uint8_t a; uint16_t x __attribute__((packed)); };", 1, "of a member changes the layout"),
        ("struct b { int x y; };\n", 1, "not understood (before: y)"),
        ("FOO(struct b { int x; });\n", 1, "not understood"),
        ("#if A > 3\nstruct b { int x; };\n#endif", 1, "condition 'A > 3' is not evaluated"),
        ("#define F(x) x\n", 1, "macro F is left out"),
        ("struct b { };\n", 1, "structure b is left out: it has no members"),
        ("STD_PACKED struct b { int a; };\n", 1, "STD_PACKED is not known and ignored"),
        ("#error no\n", 1, "#error is ignored"),
        ("#pragma pack(banana)\n", 1, "#pragma pack(banana) is not understood"),
        ("#define E \\\n 1 @ \\x\nint a[E];\n", 1, "macro E is left out"),
        ("#define E 1\n", 1, "constant E (1) is left out"),
        ("enum e { e_a, e_b = -1 };\nstruct b { int a; };", 0, ""),
        ("struct b { int Ab; int ab; };", 1, "member 'ab' is called ab_2: ab is taken"),
    ],
)
def test_notes(imported: Import, text: str, line: int, note: str) -> None:
    found = imported(read_header, f"{text}\nstruct s {{ uint8_t a; }};", "x.h")
    if note:
        assert any(each.startswith(f"{line}: note:") and note in each for each in found.notes), found.notes
    else:
        assert found.notes == []


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("", "the header has no structure that can be a message"),
        ("int x;", "the header has no structure that can be a message"),
        ("/* never closed", "a comment begins here and does not end"),
        ("\n struct s { int a;", "2: '{' is not closed"),
        ("struct s { int a) };", "1: ')' does not close an open bracket"),
        ("{" * 60, "1: brackets are nested more than 50 deep"),
        ("#if 1\nstruct s { int a; };", "an #if is not closed"),
        ("#endif", "1: #endif without #if"),
        ("#if 1\n" * 200, "101: conditions are nested more than 100 deep"),
        ("struct s { int a; }", "the header has no structure that can be a message"),
        ("\n\\", "2: the character U+005C is not part of C"),
        (b"\x7fELF\0\0", "1: a byte 00: this is not a text file"),
        (b"\xff\xfeab\0", "is not UTF-16"),
        ("\n".join(f"#define M{n} M{n + 1} M{n + 1}" for n in range(40)) + "\nM0;", "expand to more than"),
        (b"x" * (5 << 20), "more than 4194304 bytes"),
    ],
)
def test_errors(tmp_path: Path, text: str | bytes, error: str) -> None:
    assert error in refused(tmp_path, read_header, text, "x.h")


RECORDS = """\
__BEGIN_DECLS
typedef struct { int16_t x, y; } point_t;
/** A part of a path. */
struct __packed segment { point_t from, to; struct { uint8_t speed; uint8_t key[4]; } how; };
typedef struct { bool open; struct segment path[3]; enum kind { KIND_A, KIND_B } kind; float f[2]; } route_t;
__END_DECLS
"""


def test_structures_inside_others(imported: Import) -> None:
    """They are records, each before those that contain it."""
    found = imported(read_header, RECORDS, "route.h")
    assert found.part("types") == {
        "point": {"fields": {"x": "i16", "y": "i16"}},
        "segment_how": {"fields": {"speed": "u8", "key": "bytes[4]"}},
        "segment": {
            "doc": "A part of a path.",
            "fields": {"from": "point", "to": "point", "how": "segment_how"},
        },
    }
    assert found.part("messages", "route", "fields") == {
        "open": "bool", "path": "segment[3]", "kind": "kind", "f": "f32[2]",
    }  # fmt: skip


def test_a_chosen_structure(tmp_path: Path, imported: Import) -> None:
    text = "struct a { uint8_t x; };\nstruct s { uint8_t y; };"
    found = imported(lambda path, notes: read_header(path, notes, structs=["s"], name="other"), text, "x.h")
    assert found.part("protocol", "name") == "other"
    assert list(found.data["messages"]) == ["s"]  # type: ignore[arg-type]
    assert "structure t is not in the header" in refused(
        tmp_path, lambda path, notes: read_header(path, notes, structs=["t"]), text
    )


def test_other_encodings(imported: Import) -> None:
    text = "struct s { uint8_t a; /* in °C */ };"
    assert fields(imported, text) == {"a": {"type": "u8", "doc": "in °C"}}
    latin = imported(read_header, text.encode("latin-1"), "x.h")
    assert latin.part("messages", "s", "fields", "a", "doc") == "in °C"
    assert latin.notes == ["1: note: byte B0 is not UTF-8; the file is read as Windows-1252"]
    wide = imported(read_header, text.encode("utf-16"), "x.h")
    assert wide.part("messages", "s", "fields", "a", "doc") == "in °C"


TEXT = "\"}]'{: - # & * ! | > % @ ` \\ ${x} {{x}} \x1b[31m \u202e %s; system(1)"


def test_no_text_becomes_anything_else(imported: Import) -> None:
    text = f"struct s {{ uint8_t a; // {TEXT} é\n uint8_t b; /* {TEXT} */ }};"
    found = fields(imported, text)
    assert isinstance(found, dict)
    for each in found.values():
        assert each["doc"].startswith(TEXT[:30])


WORDS = """struct union enum typedef s t { } ( ) [ ] ; , : = * 1 0 8 uint8_t uint32_t int char x y A
    #if #ifdef #else #endif #define #undef #include #pragma pack(1) pack(pop) __attribute__ packed
    /* */ // " ' \\ 0x 1e9 << - [[ ]] é"""
LINES = [
    "struct s { uint8_t a; };",
    "enum e { A, B };",
    "typedef struct {",
    "} t;",
    'extern "C" {',
    "uint8_t b:3;",
]
PIECES = st.sampled_from([*WORDS.split(), *LINES, "\n", "\n", "\n"])


@given(text=st.lists(PIECES, max_size=60).map(" ".join))
def test_any_pieces(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    survives(tmp_path_factory.getbasetemp(), read_header, text)


@given(data=st.binary(max_size=200))
def test_any_bytes(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    survives(tmp_path_factory.getbasetemp(), read_header, data)


@given(cut=st.integers(0, len(HEADER)), width=st.integers(0, 20), put=st.text(max_size=5))
def test_a_mutated_header(tmp_path_factory: pytest.TempPathFactory, cut: int, width: int, put: str) -> None:
    text = HEADER[:cut] + put + HEADER[cut + width :]
    survives(tmp_path_factory.getbasetemp(), read_header, text.encode("utf-8", "replace"))
