"""Names that would mean something else in a language are spelled apart, and no others are."""

from __future__ import annotations

import pytest

from qlinkgen.model import naming

_INTEGERS = [f"{sign}int{bits}_t" for sign in ("", "u") for bits in (8, 16, 32, 64)]
_LEAST = [
    f"{sign}int_{kind}{bits}_t"
    for sign in ("", "u")
    for kind in ("fast", "least")
    for bits in (8, 16, 32, 64)
]


@pytest.mark.parametrize("name", [*_INTEGERS, "alignas", "hyper", "errno"])
def test_words_of_c_are_no_members(name: str) -> None:
    assert (naming.member(name), naming.address_member(name)) == (f"{name}_", f"{name}_")
    assert naming.handler(name, "address") == f"{name}_"


def test_other_names_stay() -> None:
    assert [naming.member(each) for each in ("speed", "int128_t", "int_fast8_t")] == [
        "speed",
        "int128_t",
        "int_fast8_t",
    ]
    assert (naming.address_member("size"), naming.address_member("unit")) == ("size_", "unit")


def test_a_handler_is_told_from_the_address_of_its_table() -> None:
    names = ["unit", "context", "node", "tank", "zone"]
    assert [naming.handler(each, "unit") for each in names] == ["unit_", "context_", "node_", "tank", "zone"]


def test_a_type_of_c_is_not_hidden() -> None:
    for name in (*_LEAST, "max_align_t", "sig_atomic_t"):
        protocol, _, rest = name.removesuffix("_t").partition("_")
        assert naming.stem(protocol, rest, "enum") == f"{rest}_enum"
        assert naming.stem(protocol, rest + "x", "enum") == rest + "x"
    assert [naming.stem("p", each, "flags") for each in ("error", "crc_x", "fine")] == [
        "error_flags",
        "crc_x_flags",
        "fine",
    ]


def test_classes_are_told_from_messages_and_from_what_a_module_has() -> None:
    messages = frozenset({"Mode"})
    assert naming.constant_class("mode", "enum", messages) == "ModeEnum"
    assert naming.constant_class("fault", "flags", messages) == "FaultFlags"
    assert naming.constant_class("speed", "enum", messages) == "Speed"
    assert [naming.message_class(each) for each in ("codec", "true", "speed.request")] == [
        "Codec_", "True_", "SpeedRequest"
    ]  # fmt: skip


def test_an_address_hides_neither_a_type_nor_an_argument() -> None:
    names = ["int", "payload", "class", "node"]
    assert [naming.address_attribute(each) for each in names] == ["int_", "payload", "class_", "node"]
    assert [naming.address_argument(each) for each in names] == ["int_", "payload_", "class_", "node"]


def test_conversions() -> None:
    assert naming.pascal("motion_x.request") == "MotionXRequest"
    assert (naming.snake("a.b"), naming.upper("a.b")) == ("a_b", "A_B")
