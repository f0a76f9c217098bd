"""Names in the output: conversion, and the words that cannot be used."""

from __future__ import annotations

import keyword

#: Words that cannot name an attribute in Python.
PYTHON_RESERVED = frozenset(keyword.kwlist)

#: Words that cannot name a struct member in C99, C11 or C++17 (alternative operator names included).
C_RESERVED = frozenset(
    """
    alignas alignof and and_eq asm auto bitand bitor bool break case catch char char16_t char32_t class compl
    const const_cast constexpr continue decltype default delete do double dynamic_cast else enum explicit
    export extern false float for friend goto if inline int long mutable namespace new noexcept not not_eq
    nullptr operator or or_eq private protected public register reinterpret_cast restrict return short signed
    sizeof static static_assert static_cast struct switch template this thread_local throw true try typedef
    typeid typename typeof union unsigned using virtual void volatile wchar_t while xor xor_eq
    """.split()  # noqa: SIM905 - reads better than sixty quoted words
)

#: Attributes that generated message classes have themselves, and what their methods call the message.
GENERATED_ATTRIBUTES = frozenset(
    {"to_bytes", "from_bytes", "to_frame", "to_dict", "from_dict", "from_checked", "measure_payload", "self"}
)


#: Names that generated modules and headers give to things of their own.
GENERATED_NAMES = frozenset(
    """
    async_master_calls async_node_calls bus codec_error command decode_error encode_error error event fault
    frame master master_calls message node_calls receiver slave slave_handlers status stream_decoder
    """.split()  # noqa: SIM905 - as above
)


def pascal(name: str) -> str:
    """``motion.request`` as a class name: ``MotionRequest``."""
    return "".join(word[:1].upper() + word[1:] for word in name.replace(".", "_").split("_"))


def snake(name: str) -> str:
    """``motion.request`` as a C name without its prefix: ``motion_request``."""
    return name.replace(".", "_")


def upper(name: str) -> str:
    """``motion.request`` as a constant: ``MOTION_REQUEST``."""
    return snake(name).upper()
