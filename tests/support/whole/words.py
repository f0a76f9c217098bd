"""Names and texts of random schemas: ordinary ones, and ones that break careless generators."""

from __future__ import annotations

import builtins
import keyword

PROTOCOLS = ("tank", "oven", "pump_bus", "lamp", "feeder", "valve_net")
HOSTILE_PROTOCOLS = ("time", "errno", "stdint", "stdio", "con", "linux", "unix", "string", "int_", "signal")

NAMES = tuple(
    """
    speed level counter mode position torque current voltage limit ramp window offset gain phase station
    channel input output target actual error_code serial version pressure density gear heater fan door lamp
    motor axis segment sample record total lower upper first last key label note count size number flow
    """.split()  # noqa: SIM905 - reads better than fifty quoted words
)

_C_WORDS = """
    auto break case char const default do double enum extern float for goto if inline int long register
    restrict
    return short signed sizeof static struct switch typedef union unsigned void volatile while bool true false
    null offsetof setjmp isnan major minor va_arg errno assert stdin stdout linux unix i386 complex signbit
    nan infinity eof uint8_t size_t memcpy memset main abs exp signal
    class template this namespace operator new delete public private virtual typename using try catch throw
"""
_TEMPLATE_LOCALS = """
    len bytes cls self message payload raw wire frame head data buf buffer start end index at value size
    count
    capacity status event receiver slave master node address direction check crc body number kind item items
    mask
    steps constant whole decimal counters struct fields text default minimum maximum scale request response
    command
    codec_error decode_error known found out to from capacity sent used position state total first type id
    name
    encode decode pack unpack table checksum length
"""
HOSTILE = tuple(
    dict.fromkeys(
        [
            *(word for word in (*keyword.kwlist, *keyword.softkwlist) if word.islower() and word != "_"),
            *(word for word in dir(builtins) if word.isidentifier() and word.islower() and word[0] != "_"),
            *_C_WORDS.split(),
            *_TEMPLATE_LOCALS.split(),
        ]
    )
)

TEXTS = ("Height of the liquid", "Set by the user; kept", "Number of steps", "Sent once a second")
HOSTILE_TEXTS = (
    'Two inches (2")',
    "the user's guide",
    "C:\\Users\\new\\manual.pdf",
    "first line\nsecond line",
    'ends in a quote"',
    'three """ in a row',
    "ends a comment */ int x;",
    "opens one /* and ??/",
    "a backslash at the end \\",
    "{% raw %} {{ name }} {# no #}",
    "%s {0} $HOME `date` <b>&amp;",
    "Grad °C, Ohm Ω, µs",
    "# not a comment",
    "// neither",
)
UNITS = ("mm", "degC", "s", "rpm", "V", "%")
HOSTILE_UNITS = ('"', 'mm" if 1 else "', "°C", "*/", "\\", "'", "m/s²", '"""', "{{ unit }}")
