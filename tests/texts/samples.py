"""Texts that a schema may hold: ordinary ones that code has other uses for, and some that try to be code.

The hostile ones leave a file called `canary` in the current folder where they are executed, or break a compile.
"""

from __future__ import annotations

#: What every other text is compared with.
HARMLESS = "plain words"

ORDINARY = (
    'a 3" disc',
    '"',
    'he said """stop"""',
    '""',
    "user's guide",
    "'''",
    "C:\\Users\\manual.pdf",
    "ends with a backslash \\",
    "\\",
    "\\N{BULLET} \\u0041 \\x41 \\0 \\",
    "two lines,\nthe second one",
    "a\ttab",
    "a */ b",
    "/* c",
    "*/*/ **// /*/",
    "what??/",
    "what???/ ??= ??' really??!",
    "// line",
    "# hash # noqa # type: ignore",
    "%s %(name)d %",
    "{0} {name!r} {}",
    "{{ title }} {% raw %} {# c #}",
    "<b> & [bold]red[/bold] [/] :warning:",
    "größe in µm, 25 °C, 単位, \U0001f600",
    "no\u00a0break",
    "Decimal( Steps( Callable struct_error unpack_from( MeasureRequest",
    "def public(): pass",
    "null",
    "7.10",
    ". . .",
    "word" * 60,
)

_TOUCH = "__import__('pathlib').Path('canary').touch()"
HOSTILE = (
    f'mm" if not {_TOUCH} else "',
    f"mm' if not {_TOUCH} else '",
    f'""" + str({_TOUCH}) + """',
    f'"""\n{_TOUCH}\n"""',
    f"x\n{_TOUCH}\n# y",
    f'\\"""\n{_TOUCH}\n"""',
    f'", {_TOUCH}, "',
    f"{{{_TOUCH}}}",
    f"{{{{ {_TOUCH} }}}}",
    "{{ cycler.__init__.__globals__.os.mkdir('canary') }}",
    "*/ int canary; /*",
    "*/\n#error canary\n/*",
    "??/\n*/ int canary; /*",
    "\\\n#error canary",
    '"\n#error canary\n"',
)

TEXTS = (*ORDINARY, *HOSTILE)
