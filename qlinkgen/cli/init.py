"""``qlinkgen init``: write a schema to begin with."""

from __future__ import annotations

import re
from pathlib import Path

import click

from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.common import find_schema, load_protocol
from qlinkgen.schema.kinds import NAME_PATTERN

_TEMPLATE = """\
qlinkgen: 1
protocol:
  name: sample
  title: ""
  revision: "1"
  source: Title of the document
  doc: What the protocol is for.
byteorder: big

frame:
  parts:
    start: AA 55
    length: {type: u8, counts: [node, code, data]}
    node: {role: address, type: u8}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..64}
    crc: {type: u16, algorithm: crc-16/modbus, over: [length, node, code, data]}

bus: {kind: master_slave, nodes: 1..16, baud: 115200, response_within: 50 ms}

defaults: {addressing: node, repeat: safe}

commands:
  get_version:
    id: 0x01
    doc: Read the version of the firmware.
    request: {}
    response:
      major: {type: u8, doc: Major version}
      minor: {type: u8, doc: Minor version}
"""
_SERVER = re.compile(r"\A# yaml-language-server: .*\n")
_INCLUDE = re.compile(r"^include: (\S+)$", re.MULTILINE)


@click.command("init")
@click.argument("name")
@click.option("--like", metavar="PROTOCOL", help="Begin with the schema of this protocol.")
def command(name: str, like: str | None) -> None:
    """Write NAME.yaml, a schema to begin with, and print its path. Existing files are not replaced.

    Without --like it is a small bus; `qlinkgen list` prints the protocols to choose from.

    \b
    qlinkgen init pump
    qlinkgen init my_meter --like modbus_rtu
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    if not re.fullmatch(NAME_PATTERN, name):
        raise Failure(f"'{name}' is not a name; use lower case letters, digits and underscores: my_bus")
    texts = {Path(f"{name}.yaml"): _named(_TEMPLATE, "sample", name)}
    if like is not None:
        source = find_schema(like)
        text = source.read_text("utf-8")
        texts = {Path(f"{name}.yaml"): _named(_SERVER.sub("", text), load_protocol(like).name, name)}
        for other in _INCLUDE.findall(text):
            texts[Path(other)] = _SERVER.sub("", (source.parent / other).read_text("utf-8"))
    if existing := [path for path in texts if path.exists()]:
        raise Failure(f"{existing[0]} exists; choose another name, or move it away")
    for path, text in texts.items():
        path.write_text(text, "utf-8")
        click.echo(path)


def _named(text: str, before: str, name: str) -> str:
    """A schema with another name of the protocol."""
    return re.sub(rf"\bname: {before}\b", f"name: {name}", text, count=1)
