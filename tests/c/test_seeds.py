"""Check values in C that cover an attribute of the message, which an id that no message has does not tell."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.schema import loads
from tests.support.cdriver import WARNINGS

SCHEMA = """
qlinkgen: 1
protocol: {name: seeded, revision: "1", source: Made up}
byteorder: big
attributes: {salt: {type: u8}}
frames:
  ask:
    parts: {start: 10, code: {role: message, type: u8},
            sum: {type: u8, algorithm: sum8, over: [code, attribute.salt]}}
  tell:
    parts: {start: 68, code: {role: message, type: u8},
            sum: {type: u8, algorithm: sum8, over: [code, attribute.salt]}}
bus: {kind: master_slave}
defaults: {frame: ask, repeat: safe, attributes: {salt: 3}}
commands: {read: {id: 2, request: {}, response: {frame: tell, id: 2, fields: {}}}}
"""
PROGRAM = """
#include <stdio.h>
#include "seeded.h"

int main(void)
{
    uint8_t wire[8];
    const int known = seeded_frame_encode(SEEDED_READ_RESPONSE_ID, NULL, 0u, wire, sizeof wire);
    printf("%d %02x", known, wire[2]);
    printf(" %d", seeded_frame_encode(9u, NULL, 0u, wire, sizeof wire) == SEEDED_ERROR_UNKNOWN);
    return 0;
}
"""


def test_a_frame_with_an_id_of_no_message_is_refused(
    tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    protocol, faults = loads(SCHEMA, "seeded.yaml")
    assert protocol is not None, faults
    for name, text in c.generate(protocol, Options()).items():
        (tmp_path / Path(name).name).write_text(text)
    (tmp_path / "main.c").write_text(PROGRAM)
    program = tmp_path / "main"
    command = [
        require_tool("gcc", package="gcc"),
        "-std=c99",
        *WARNINGS,
        str(tmp_path / "main.c"),
        "-o",
        str(program),
    ]
    subprocess.run(command, check=True, timeout=60)
    done = subprocess.run([str(program)], capture_output=True, text=True, timeout=10, check=True)
    assert done.stdout == "3 05 1"
