"""Examples of a schema: any frame of an encoder is one, and each becomes a vector."""

from __future__ import annotations

import json
import random
import re
from collections.abc import Mapping
from decimal import Decimal
from typing import Any

import pytest

from qlinkgen.backends import vectors
from qlinkgen.backends.base import Options
from qlinkgen.cli.decode import message_record
from qlinkgen.model.message import Example, Message
from qlinkgen.plan import plan_of
from qlinkgen.plan.codec import Codec
from qlinkgen.schema import find, loads
from tests.python.protocols import EVERY, SHIPPED, module, protocol, text_of
from tests.support.random_raw import random_address, random_values


def text_with(name: str, examples: Mapping[str, list[Any]]) -> str:
    """The text of a schema with examples of its commands and messages."""
    text = find(name).read_text("utf-8") if name in SHIPPED else text_of(name)
    for key, rows in examples.items():
        before, bus, after = text.partition("\nbus:")
        (place,) = re.finditer(rf"^  {key}:\n", after, re.MULTILINE)
        line = f"    examples: {dumped(rows)}\n"
        text = before + bus + after[: place.end()] + line + after[place.end() :]
    return text


def frame(name: str, message: Message, rng: random.Random) -> tuple[bytes, bytes]:
    """A random frame, and the request that it answers if that matters."""
    codec = Codec(plan_of(protocol(name)))
    after = b""
    if codec.plan.frame.needs_request and message.direction == "response":
        after, _ = frame(name, protocol(name).by_name[f"{message.command}.request"], rng)
    values = dict(zip((each.name for each in message.values), random_values(message, rng), strict=True))
    address = random_address(message, rng) if message.addresses else None
    return codec.encode(message.name, values, address, after), after


def example(name: str, message: Message, rng: random.Random) -> tuple[str, Any]:
    """The key of its command or message in the file, and an example of it."""
    wire, after = frame(name, message, rng)
    plan = plan_of(protocol(name))
    direction = plan.direction_of(plan.message(message.name))
    suffix = "" if direction == "message" else f"_{direction}"
    asked = [module(name).decode_request(after)] if after else []
    record = message_record(protocol(name), getattr(module(name), f"decode{suffix}")(wire, *asked))
    for told in ("message", "refused"):
        record.pop(told, None)
    fields = record.pop("fields")
    key = "fields" if message.name == message.command else message.name.rpartition(".")[2]
    shown: dict[str, Any] = {"wire": wire.hex(" ").upper(), key: fields, **record}
    return message.command, shown | ({"after": after.hex(" ").upper()} if after else {})


def dumped(data: Any) -> str:
    """YAML as the notation of schema files needs it."""
    if isinstance(data, dict):
        return "{" + ", ".join(f"{key}: {dumped(value)}" for key, value in data.items()) + "}"
    if isinstance(data, list):
        return "[" + ", ".join(map(dumped, data)) + "]"
    if isinstance(data, float):
        return format(Decimal(str(data)), "f")
    if isinstance(data, bool):
        return str(data).lower()
    return str(data) if isinstance(data, int | Decimal) else json.dumps(data)


@pytest.mark.parametrize("name", EVERY)
def test_every_frame_is_an_example_of_its_message(name: str) -> None:
    rng = random.Random(name)
    rows: dict[str, list[Any]] = {}
    for message in protocol(name).messages:
        key, shown = example(name, message, rng)
        rows.setdefault(key, []).append(shown)
    found, faults = loads(text_with(name, rows), "with_examples.yaml")
    assert [str(each) for each in faults if each.severity == "error"] == []
    assert found is not None
    assert len(found.examples) == len(protocol(name).messages)
    made = json.loads(vectors.generate(found, Options())[f"vectors/{name}.json"])["vectors"]
    for each in found.examples:
        same = [row for row in made if row["message"] == each.message and row["wire"] == each.wire.hex()]
        assert any("example" in row["kinds"] for row in same)


def test_with_another_checksum_the_bytes_of_the_document_do_not_count() -> None:
    rows = {"node_info": [{"wire": "A5 A5 04 02 03 46 5D", "node": 3, "request": {}}]}
    text = text_with("qlink", rows)
    found, _ = loads(text, "qlink.yaml")
    assert found is not None
    assert found.examples == (Example("node_info.request", bytes.fromhex("A5A5040203465D")),)
    other, faults = loads(text, "qlink.yaml", crc="crc-16/xmodem")
    assert other is not None, faults
    assert other.examples == ()
