"""Words with a meaning in a language, a library, or the generated code itself.

The lists of the product are not used: keywords are those of the languages, macros those of the headers of the
C library, and the others are identifiers of generated files whose schemas have neutral names.
"""

from __future__ import annotations

import builtins
import inspect
import io
import keyword
import re
import subprocess
import tokenize
from collections.abc import Iterable, Iterator

from qlinkgen.backends.base import Options
from qlinkgen.cli.targets import TARGETS
from qlinkgen.transport import aio, blocking
from tests.names.documents import Document

#: Keywords of C up to C23 and of C++ up to C++23, and usual extensions.
C_KEYWORDS = """alignas alignof and and_eq asm auto bitand bitor bool break case catch char char8_t char16_t
    char32_t class co_await co_return co_yield compl concept const const_cast consteval constexpr
    constinit continue decltype default delete do double dynamic_cast else enum explicit export extern
    false float for friend goto if import inline int long module mutable namespace new noexcept not
    not_eq nullptr operator or or_eq private protected public register reinterpret_cast requires
    restrict return short signed sizeof static static_assert static_cast struct switch template this
    thread_local throw true try typedef typeid typename typeof typeof_unqual union unsigned using
    virtual void volatile wchar_t while xor xor_eq final override interrupt near far huge small
    cdecl""".split()  # noqa: SIM905 - reads better than quoted words
#: Usual names in protocols.
USUAL = """a b c i j k m n p s t x y z address axis buffer bus check checksum code command count crc data
    device end error event file flags frame handle head header id index init length level list main
    master max message min mode name node number object offset parity payload port position power raw
    read receive request reset response result role send sent set signal size slave speed start state
    status stop string sum sync text time timer to type unit user value version wire word write x1 y2
    con nul aux prn com1 lpt9 u8 i16 fixed bytes u8_t i_""".split()  # noqa: SIM905 - reads better than quoted words
#: The pattern of a name.
NAME = re.compile(r"[a-z][a-z0-9_]{0,31}")
#: Names in the neutral schemas.
_MADE = re.compile(r"(plain|([a-z])\2)(_|\Z)")
#: Comments, texts and numbers of C.
_NO_CODE = re.compile(r'/\*.*?\*/|"(?:[^"\\]|\\.)*"|\b[0-9][0-9A-Za-z]*', re.DOTALL)
_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


def macros(compiler: str) -> set[str]:
    """Macros without arguments that the headers of the C library define."""
    headers = "assert complex ctype errno fenv inttypes limits locale math setjmp signal stdarg stdio stdlib"
    text = "".join(f"#include <{each}.h>\n" for each in f"{headers} string time unistd fcntl poll".split())
    command = [compiler, "-dM", "-E", "-x", "c", "-"]
    done = subprocess.run(command, input=text, capture_output=True, text=True, check=True, timeout=60)
    return set(re.findall(r"#define ([a-z][a-z0-9_]*) ", done.stdout))


def of_python() -> set[str]:
    """Keywords, built-in names, and members of bus classes."""
    public = {name for module in (aio, blocking) for _, each in inspect.getmembers(module, inspect.isclass)
              for name in dir(each)}  # fmt: skip
    return {*keyword.kwlist, *keyword.softkwlist, *dir(builtins), *public}


def of_generated(documents: Iterable[Document], targets: Iterable[str]) -> set[str]:
    """Identifiers in the code of these targets, with and without the prefix of the protocol's name."""
    found: set[str] = set()
    for document in documents:
        protocol = document.protocol()
        for target in targets:
            for path, text in TARGETS[target].load()(protocol, Options()).items():
                code = _of_python(text) if path.endswith(".py") else _of_c(text)
                found |= {each.lower() for each in code}
        found |= {each.removeprefix(f"{protocol.name}_") for each in found}
    return found | {each.removesuffix("_t") for each in found}


def _of_c(text: str) -> Iterator[str]:
    yield from _IDENTIFIER.findall(_NO_CODE.sub(" ", text))


def _of_python(text: str) -> Iterator[str]:
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.NAME:
            yield token.string


def names(words: Iterable[str]) -> list[str]:
    """The words that a schema may use as names, sorted; a final "_" marks the variant of another word."""
    return sorted(
        {word for word in words if NAME.fullmatch(word) and not _MADE.match(word) and word[-1] != "_"}
    )
