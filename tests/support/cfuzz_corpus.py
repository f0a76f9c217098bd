"""The committed inputs of the fuzz targets: one line of hex digits each, for all shipped protocols.

    python -m tests.support.cfuzz_corpus [--seconds N] [TARGET...]

updates them: fuzzes each target from the present inputs and the shipped vectors, then keeps a minimal set of
inputs with the same coverage. Needs clang and libFuzzer.
"""

from __future__ import annotations

import argparse
import json
import random
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from qlinkgen.backends import c
from qlinkgen.backends.base import Options
from qlinkgen.backends.c.interface import interface
from qlinkgen.model.message import Message
from qlinkgen.model.protocol import Protocol
from qlinkgen.schema import find, load
from tests.support.cfuzz import FUZZER, TARGETS, compiled, program

SHIPPED = ("qlink", "trio", "mc1231a")
CORPUS = Path(__file__).parents[1] / "c" / "corpus"
#: Edges implied by others are counted too, because gcov requires them.
EVERY_EDGE = ("-fsanitize-coverage=no-prune",)
#: Inputs that gcov distinguishes but the fuzzer does not: a Trio header of a known message with address 0,
#: and an MC1231A packet with one byte too many. And an input that an error might accept: a Q.link length
#: above the maximum, with as many bytes; and a Q.link frame that ends before an inserted byte.
KEPT = {
    "receiver": ("01000181", "000000a5a540" + 70 * "11"),
    "decoders": ("0201000100", "000100a5a504a5"),
    "dispatch": (),
}
_ROOT = Path(__file__).parents[2]


def read(target: str) -> list[bytes]:
    """The inputs of a target."""
    lines = (CORPUS / f"{target}.hex").read_text("ascii").splitlines()
    return [bytes.fromhex(line) for line in lines if not line.startswith("#")]


def write(target: str, inputs: list[bytes]) -> None:
    """Replace the inputs of a target."""
    CORPUS.mkdir(exist_ok=True)
    head = f"# Inputs of the fuzz target {target}; made by python -m tests.support.cfuzz_corpus\n"
    lines = sorted({each.hex() for each in inputs}, key=lambda line: (line[:2], len(line), line))
    (CORPUS / f"{target}.hex").write_text(head + "".join(f"{line}\n" for line in lines if line), "ascii")


def unpack(inputs: list[bytes], folder: Path) -> Path:
    """Write one file per input, as libFuzzer requires."""
    folder.mkdir(parents=True)
    for number, each in enumerate(inputs):
        (folder / f"{number:05}").write_bytes(each)
    return folder


def write_program(folder: Path, name: str, targets: tuple[str, ...]) -> str:
    """Write the source of the targets for all shipped protocols, with headers; returns the program's name."""
    protocols = [load(find(each)) for each in SHIPPED]
    for protocol in protocols:
        (text,) = c.generate(protocol, Options()).values()
        (folder / f"{protocol.name}.h").write_text(text, "utf-8")
    (folder / f"{name}.c").write_text(program(protocols, targets), "utf-8")
    return name


def seeds(target: str) -> list[bytes]:
    """Inputs from the shipped vectors: every message, decoded and encoded."""
    found = []
    for number, name in enumerate(SHIPPED):
        protocol = load(find(name))
        vectors = json.loads((_ROOT / "generated" / "vectors" / f"{name}.json").read_text("utf-8"))["vectors"]
        for vector in vectors:
            message = protocol.by_name[vector["message"]]
            found += [bytes([number]) + rest for rest in _seeds(target, protocol, message, vector)]
    return found


def _seeds(target: str, protocol: Protocol, message: Message, vector: dict[str, Any]) -> list[bytes]:
    # Zeros select the largest buffer, supported commands and the address of the slave.
    payload, wire = bytes.fromhex(vector["payload"]), bytes.fromhex(vector.get("wire", ""))
    answer, rng = bytes([message.direction == "response"]), random.Random(vector["payload"])
    place = bytes([protocol.bus.nodes[0]]) if protocol.bus.nodes else b""
    own = bytes([message.id])
    noise = bytes(rng.choice((0, 1, rng.randrange(256))) for _ in range(60))
    if target == "receiver":
        return [answer + own + wire, answer + own + wire[:-1] + noise[:2]]
    if target == "decoders":
        whom = place
        if interface(protocol).packets and message.direction == "response":
            whom = _sum(bytes.fromhex(vector["request"]))
            return [
                b"\3" + own + whom + wire,
                b"\3" + own + whom + bytes(2) + wire,
                *_values(answer + own, whom, noise),
                *_payloads(answer + own + place, payload),
            ]
        return [
            b"\1" + answer + wire,
            b"\3" + answer + b"\0" + own + place + payload,
            *_values(answer + own, place, noise),
            *_payloads(answer + own + place, payload),
            *(b"\0" + answer + own + other + payload for other in (b"\0", b"\xff") if place),
        ]
    asked = bytes([0, 0, 0, min(len(payload), 255), 0]) + own + payload
    received = b"\1\0" + own + place + payload
    return [received, received + b"\0", asked + bytes(60), asked + noise]


def _values(head: bytes, whom: bytes, noise: bytes) -> list[bytes]:
    return [
        b"\2" + head + b"\0" + whom + values
        for values in (bytes(40), b"\xff" * 40, b"\x80" + bytes(39), noise)
    ]


def _payloads(head: bytes, payload: bytes) -> list[bytes]:
    return [b"\0" + head + each for each in _payload_variants(payload)]


def _payload_variants(payload: bytes) -> tuple[bytes, ...]:
    least = b"\x80" + bytes(len(payload) - 1) if payload else b""
    return payload, payload[:-1], payload + b"\0", payload + b"\xff" * 30, least


def _sum(request: bytes) -> bytes:
    words = [int.from_bytes(request[at : at + 2], "big") for at in range(1, len(request), 2)]
    return ((request[0] + sum(words)) & 0xFFFF).to_bytes(2, "big")


def grow(target: str, seconds: int) -> None:
    """Fuzz a target, and keep a minimal set of inputs with the same coverage."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_program(folder, target, (target,))
        done = compiled(shutil.which("clang") or "clang", folder, target, *FUZZER, *EVERY_EDGE)
        if done.returncode:
            raise SystemExit(done.stderr)
        known = read(target) if (CORPUS / f"{target}.hex").exists() else []
        found = unpack(known + seeds(target), folder / "found")
        least = unpack([], folder / "least")
        run = [
            str(folder / target),
            f"-artifact_prefix={folder}/",
            "-max_len=300",
            "-verbosity=0",
            "-print_funcs=0",
        ]
        subprocess.run([*run, f"-max_total_time={seconds}", str(found)], check=True)
        # Without counters an input is kept for the edges it reaches, not for their counts.
        subprocess.run([*run, "-set_cover_merge=1", "-use_counters=0", str(least), str(found)], check=True)
        inputs = [file.read_bytes() for file in least.iterdir()] + [
            bytes.fromhex(line) for line in KEPT[target]
        ]
        write(target, inputs)
        print(f"{target}: {len(inputs)} inputs, {sum(map(len, inputs))} bytes")


def main() -> None:
    """Fuzz the targets named on the command line, or all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=", ".join(TARGETS))
    parser.add_argument("--seconds", type=int, default=60, help="to fuzz each target (default: 60)")
    options = parser.parse_args()
    for target in options.targets or TARGETS:
        grow(target, options.seconds)


if __name__ == "__main__":
    main()
