"""The same message through MAVLink's and nanopb's C code, generated now and not kept."""

from __future__ import annotations

import contextlib
import importlib
import io
import re
import shutil
import subprocess
import sys
import tarfile
from dataclasses import dataclass
from pathlib import Path

from benchmarks.firmware_build import PROGRAMS, Size, Target, ToolMissing, Workshop, run, size_of, tool
from benchmarks.firmware_stack import CallGraph, UnknownDepth
from benchmarks.peer import PeerMissing, load
from benchmarks.peers_generated import MAVLINK_XML

_ONE_CHANNEL = ("-DMAVLINK_COMM_NUM_BUFFERS=1", "-DMAVLINK_MAX_PAYLOAD_LEN=32")
_LEAN = ("-DPB_NO_ERRMSG", "-DPB_BUFFER_ONLY", "-DPB_WITHOUT_64BIT")
_RUNTIME = ("pb_common.c", "pb_decode.c", "pb_encode.c")


@dataclass(frozen=True)
class Footprint:
    """A peer's program less the empty one; `stack` is None if its bound cannot be computed."""

    size: Size
    stack: int | None


@dataclass(frozen=True)
class Peer:
    """One way to build a peer's program."""

    name: str
    source: Path
    options: tuple[str, ...]


def measured(
    shop: Workshop, targets: tuple[Target, ...], missing: list[str]
) -> dict[str, dict[str, Footprint]]:
    """Each peer on each target; `missing` gets the reason for each missing peer."""
    found = {}
    for make in (mavlink, nanopb):
        try:
            peers = make(shop.folder)
        except PeerMissing as reason:
            missing.append(str(reason))
            continue
        for peer in peers:
            found[peer.name] = {target.name: _footprint(shop, target, peer) for target in targets}
    return found


def _footprint(shop: Workshop, target: Target, peer: Peer) -> Footprint:
    name = "peer-" + re.sub(r"\W+", "-", peer.name)
    program = shop.link(target, name, peer.source, peer.options)
    empty = shop.size(target, "empty", PROGRAMS / "core.c", ["-DEMPTY"])
    return Footprint(size_of(target, program) - empty, _stack(target, program))


def _stack(target: Target, program: Path) -> int | None:
    # Calls through pointers are ignored: MAVLink's callback is not set. nanopb recurses for messages in
    # messages.
    try:
        return CallGraph(target, program, pointed_to=()).depth("main")
    except UnknownDepth:
        return None


def mavlink(folder: Path) -> list[Peer]:
    """MAVLink 1 and 2, as generated and with one channel and a short longest message."""
    load("pymavlink")
    mavgen = importlib.import_module("pymavlink.generator.mavgen")
    peers = []
    for version in ("1.0", "2.0"):
        place = folder / f"mavlink-{version}"
        place.mkdir(exist_ok=True)
        (place / "motion.xml").write_text(MAVLINK_XML)
        options = mavgen.Opts(
            output=str(place), wire_protocol=version, language="C", validate=False, strict_units=False
        )
        with contextlib.redirect_stdout(io.StringIO()):
            mavgen.mavgen(options, [str(place / "motion.xml")])
        # As a system folder: without its warnings.
        include = ("-std=gnu99", "-isystem", str(place))
        name, source = f"MAVLink {version[0]}", PROGRAMS / "mavlink.c"
        peers += [
            Peer(f"{name}, as generated", source, include),
            Peer(f"{name}, one channel, 32 bytes", source, (*include, *_ONE_CHANNEL)),
        ]
    return peers


def nanopb(folder: Path) -> list[Peer]:
    """The payload by nanopb in this project's frame, by default and with every option to make it small."""
    load("nanopb")
    load("grpc_tools", "grpcio-tools")
    place = folder / "nanopb"
    runtime = _nanopb_runtime(place)
    for name in ("motion.proto", "motion.options"):
        shutil.copy(PROGRAMS / name, place)
    run(sys.executable, "-m", "nanopb.generator.nanopb_generator", "motion.proto", folder=place)
    sources = [str(place / "motion.pb.c"), *(str(runtime / name) for name in _RUNTIME)]
    options = ("-isystem", str(runtime), "-isystem", str(place), *sources)
    source = PROGRAMS / "nanopb.c"
    return [
        Peer("nanopb in a Q.link frame, by default", source, options),
        Peer("nanopb in a Q.link frame, all options", source, (*options, *_LEAN)),
    ]


def _nanopb_runtime(place: Path) -> Path:
    """Its C files from Debian's source package, since PyPI has only the generator."""
    (place / "apt" / "lists" / "partial").mkdir(parents=True, exist_ok=True)
    try:
        apt = tool("apt-get", "apt")
        _download(apt, place / "apt")
    except (ToolMissing, RuntimeError, subprocess.SubprocessError) as error:
        reason = str(error).strip().splitlines()[-1]
        raise PeerMissing(f"nanopb's C files (source package nanopb of Debian: {reason})") from error
    (archive,) = (place / "apt").glob("nanopb_*.orig.tar.*")
    with tarfile.open(archive) as packed:
        packed.extractall(place / "source", filter="data")
    (header,) = (place / "source").glob("*/pb.h")
    return header.parent


def _download(apt: str, place: Path) -> None:
    """Fetch a source package with separate package lists: apt's own are not changed, root is not needed."""
    site = run(
        apt, "indextargets", "--format", "$(REPO_URI) $(CODENAME)", "Created-By: Packages", "Component: main"
    )
    plain = [line for line in site.splitlines() if "-" not in line.split()[-1]]
    if not plain:
        raise RuntimeError("apt lists no repository with a component main: run apt-get update")
    (place / "sources.list").write_text(f"deb-src {plain[0]} main\n")
    own = {
        "Dir::Etc::SourceList": place / "sources.list",
        "Dir::Etc::SourceParts": "/dev/null",
        "Dir::State::Lists": place / "lists",
        "Dir::Cache": place,
        "Acquire::http::Timeout": 20,
        "Debug::NoLocking": 1,
    }
    options = [word for name, value in own.items() for word in ("-o", f"{name}={value}")]
    for command in (("update",), ("source", "--download-only", "nanopb")):
        run(apt, "-qq", *options, *command, folder=place)
