"""Draws how the host of a random schema comes back in step, and what its commands act on."""

from __future__ import annotations

import random
from typing import Any

Doc = dict[str, Any]


def come_back(rng: random.Random, document: Doc) -> None:
    """State it in most schemas of hosts whose packets have a check value and a command to ask."""
    bus, commands = document["bus"], document.get("commands", {})
    packet = document.get("frame", {}).get("packet", {})
    if bus["kind"] != "host" or len(packet) < 3 or rng.random() < 0.2:
        return
    taken = {spec["id"] for spec in commands.values()}
    free = [byte for byte in range(256) if byte not in taken]
    if "in_step" not in commands:
        number = free.pop(rng.randrange(len(free)))
        commands["in_step"] = {"id": number, "request": {}, "response": {}, "repeat": "safe"}
    bare = [name for name, spec in commands.items() if _is_bare(spec)]
    asked = [name for name in bare if commands[name].get("repeat") == "safe"]
    if not asked:
        return
    bus["resync"] = {"command": rng.choice(asked), "fill": rng.choice(free)}
    if rng.random() < 0.5:
        bus["resync"]["fills"] = {name: rng.choice(free) for name in rng.sample([*commands], 1)}
    if "level" in document.get("attributes", {}) and "level" not in commands and rng.random() < 0.7:
        numbers = rng.sample(range(9), len(bare))
        bus["select"] = {
            "attribute": "level",
            "values": [rng.choice(("user", "service"))],
            "commands": dict(zip(bare, numbers, strict=True)),
            "lost_by": rng.sample([*commands], rng.randint(0, 1)),
        }


def _is_bare(spec: Doc) -> bool:
    """Whether a command has no data, and an answer."""
    return spec.get("request") == {} and isinstance(spec.get("response"), dict)
