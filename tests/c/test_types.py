"""C types of members: one for each named type, with one pair of conversions, for any name.

The family: names that messages, enums and the header itself use too; types that fields use unchanged and
narrowed, in bits and arrays, without a scale; enums and flags in integers of their own width and of another.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.schema import loads
from tests.support.cdriver import WARNINGS

STRICT = (*WARNINGS, "-Wstrict-prototypes", "-std=c99", "-DHOST_ENABLE_FLOAT=1")
#: Names of the type and of its C type.
NAMES = {
    "speed": "speed",
    "frame": "frame_type",
    "status": "status_type",
    "set_request": "set_request_type",
    "told": "told_type",
    "told_own": "told_own_type",
    "mode": "mode_type_type",
}
SCHEMA = """
qlinkgen: 1
protocol: {{name: host, title: Host, revision: "1", source: this test, doc: Names of types.}}
byteorder: big
enums:
  level: {{type: u8, doc: D., values: {{low: 1, high: 9}}}}
  below: {{type: i16, doc: D., values: {{low: -1, high: 9}}}}
  {enum}_type: {{type: u8, doc: D., values: {{one: 1}}}}
flags: {{bits16: {{type: u16, doc: D., values: {{fast: 0, far: 4}}}}}}
types:
  {name}: {{type: i16, scale: 1/10, unit: mm}}
  plain: {{type: u24, unit: V, range: 0..9}}
  alike: {{type: u24, unit: V, range: 0..9}}
frame:
  parts:
    len: {{role: length, type: u8, counts: [id, data]}}
    id: {{role: message, type: u8}}
    data: {{role: payload, size: 0..90}}
    check: {{role: checksum, type: u8, algorithm: sum8, over: [id, data]}}
bus: {{kind: master_slave, baud: 9600, response_within: 1 ms}}
defaults: {{repeat: safe}}
commands:
  set:
    id: 1
    doc: D.
    request:
      a: {name}
      b: {{type: {name}, range: 0..5}}
      c: level
      d: bits16
      e: {{type: u8, bits: {{f: {{at: 0..1}}, g: {{at: 4..7, type: level}}}}}}
      h: below
    response: {{a: {name}, p: plain, n: {{type: u8, counts: q}}, q: "u16[0..3]"}}
  get:
    id: 3
    doc: D.
    request: {{p: plain}}
    response: {{p: {{type: plain, doc: Said.}}}}
  put:
    id: 4
    doc: D.
    request: {{p: alike}}
    response: {{p: alike}}
messages:
  {message}: {{id: 2, doc: D., fields: {{own: {{type: u16, scale: 3}}, x: {name}}}}}
"""


def header(name: str) -> str:
    message = name if name == "mode" else "told" if name.startswith("told") else "other"
    text = SCHEMA.format(name=name, message=message, enum="mode" if name == "mode" else "some")
    protocol, faults = loads(text, "host.yaml")
    assert protocol, faults
    (found,) = c.generate(protocol, Options()).values()
    return found


@pytest.mark.parametrize(("name", "stem"), NAMES.items())
def test_a_type_converts_once(name: str, stem: str) -> None:
    text = header(name)
    assert f"typedef int16_t host_{stem}_t;" in text
    assert text.count(f"host_{stem}_t a;") == 2
    assert len(re.findall(r"static inline host_real_t \w+_physical", text)) == 3  # the type, narrowed, own
    assert f"host_real_t host_{stem}_physical(host_{stem}_t raw)" in text
    assert "host_set_request_b_raw(host_real_t physical, int16_t *raw)" in text
    for member in ("host_level_t c;", "host_bits16_t d;", "host_below_t h;", "host_plain_t p;"):
        assert member in text


@pytest.mark.parametrize("compiler", ["gcc", "clang", "avr-gcc"])
def test_every_name_is_clean(compiler: str, tmp_path: Path, require_tool: Callable[..., str]) -> None:
    files = []
    for name in NAMES:
        (tmp_path / f"{name}.h").write_text(header(name))
        (tmp_path / f"{name}.c").write_text(
            f'#include "{name}.h"\nint used(void);\nint used(void) {{ return 0; }}\n'
        )
        files.append(f"{name}.c")
    package, target = ("gcc-avr", ["-mmcu=atmega328p"]) if compiler == "avr-gcc" else (compiler, [])
    words = [require_tool(compiler, package=package), *target, *STRICT, "-fsyntax-only", *files]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:3000]


def test_equal_messages_share_code() -> None:
    """Equal messages share a struct and its code, but not with other member types; all texts are kept."""
    text = header("speed")
    assert "/* p: Said.; in V; 0..9 */\ntypedef host_get_request_t host_get_response_t;" in text
    assert "#define HOST_GET_RESPONSE_INIT HOST_GET_REQUEST_INIT" in text
    assert text.count("return host_get_request_decode(message, payload, size);") == 1
    assert "host_alike_t p; " in text
    assert "typedef host_put_request_t host_put_response_t;" in text
