"""Words that code has other uses for, in the spelling that a schema has: lower case, with underscores."""

from __future__ import annotations

import ast
import builtins
import functools
import keyword
import re
import subprocess
from collections.abc import Iterator, Mapping

import construct

#: Keywords of C99 to C23 and C++98 to C++23, alternative operators, and words of compilers.
C_KEYWORDS = """alignas and and_eq asm atomic_cancel atomic_commit atomic_noexcept auto bitand bitor bool
    alignof break case catch char char16_t char32_t char8_t class co_await co_return co_yield compl concept
    const const_cast consteval constexpr constinit continue decltype default delete do double
    dynamic_cast else enum explicit export extern false float for friend goto if import inline int
    long module mutable namespace new noexcept not not_eq nullptr operator or or_eq private
    protected public reflexpr register reinterpret_cast requires restrict return short signed sizeof
    static static_assert static_cast struct switch synchronized template this thread_local throw
    true try typedef typeid typename typeof typeof_unqual union unsigned using virtual void volatile
    wchar_t while xor xor_eq final override near far huge interface cdecl pascal interrupt asm linux
    unix i386 arm mips vax""".split()  # noqa: SIM905
#: Headers that a program may include before or after the generated one.
_HEADERS = """assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal stdalign
    stdarg stdatomic stdbool stddef stdint stdio stdlib stdnoreturn string tgmath threads time uchar
    wchar wctype""".split()  # noqa: SIM905
_MORE = "sys/types sys/sysmacros sys/stat sys/time sys/socket unistd fcntl pthread termios poll".split()  # noqa: SIM905
#: Names of files that no header, module or file may have: those above, modules of Python, devices of Windows.
FILES = (
    *_HEADERS,
    *"types codecs struct enum typing abc re os sys io unistd con prn aux nul com1 lpt9".split(),  # noqa: SIM905
)
INCLUDES = "".join(f"#include <{name}.h>\n" for name in (*_HEADERS, *_MORE))


def snake(name: str) -> str:
    """A name of code as a schema may spell it, so that it comes back as a class or a constant."""
    bare = name.strip("_")
    if bare.isupper() and "_" not in bare:
        return bare.lower()
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", bare).lower()


def _legal(words: Iterator[str]) -> frozenset[str]:
    return frozenset(word for word in words if re.fullmatch(r"[a-z](?:_?[a-z0-9]){0,38}", word))


@functools.cache
def of_python() -> frozenset[str]:
    """Keywords and builtins."""
    words = [*keyword.kwlist, *keyword.softkwlist, *dir(builtins), *dir(construct.Container), *dir(int)]
    return _legal(iter([*map(snake, words), *map(str.lower, words)]))


@functools.cache
def macros(compiler: str) -> frozenset[str]:
    """Macros of the C library and of the compiler itself, in any case."""
    found: set[str] = set()
    for standard in ("c99", "gnu17"):
        command = [compiler, f"-std={standard}", "-dM", "-E", "-"]
        done = subprocess.run(command, input=INCLUDES, capture_output=True, text=True, check=True)
        found |= {line.split()[1].partition("(")[0] for line in done.stdout.splitlines()}
    return _legal(iter(found))


def of_module(source: str) -> frozenset[str]:
    """Every name in a module: variables, attributes, arguments, imports, functions, classes."""
    return _legal(word for name in _names(source) for word in (snake(name), _letters(name)))


def _letters(name: str) -> str:
    """A constant so that its class has its spelling: ``BUS`` is that of ``b_u_s``."""
    return "_".join(name.lower()) if name.isupper() and name.isalpha() else "_"


def _names(source: str) -> Iterator[str]:
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Name(id=name) | ast.arg(arg=name) | ast.Attribute(attr=name) | ast.alias(name=name):
                yield name
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                yield name
            case ast.keyword(arg=str(name)):
                yield name
            case _:
                pass


def of_c(source: str, prefix: str) -> frozenset[str]:
    """Every identifier of a header; of the protocol's own, what follows its name, and how that begins."""
    bare = re.sub(r'/\*.*?\*/|"[^"\n]*"', " ", source, flags=re.DOTALL)
    return _legal(
        part for name in re.findall(r"\b[A-Za-z_]\w*", bare) for part in _parts(name.lower(), prefix)
    )


def _parts(name: str, prefix: str) -> Iterator[str]:
    yield name
    rest = name.removeprefix(f"{prefix}_").strip("_")
    pieces = rest.split("_")
    yield from ("_".join(pieces[:last]) for last in range(1, len(pieces) + 1))


def sources_of(outputs: Mapping[str, str], suffixes: tuple[str, ...]) -> str:
    return "\n".join(text for path, text in outputs.items() if path.endswith(suffixes))
