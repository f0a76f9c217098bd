"""One message in Python: object to wire bytes and back, the generated module and its peers."""

from __future__ import annotations

from benchmarks import messages
from benchmarks.measure import Case, Timing, measure
from benchmarks.peer import KEYWORDS, READ_FIELDS, Peer
from benchmarks.peers import available
from benchmarks.report import Goal, Section, number
from qlinkgen.codecs import qlink

WORK = ("encode", "build", "decode", "read")
PACK, UNPACK = "raw pack", "raw unpack"

INTRO = """\
Times over raw `struct` for the nine data bytes alone, `Struct.pack` for the first two columns,
`Struct.unpack` for the others. *encode*: ready object to wire bytes; *build*: make the object by
keywords, then encode; *decode*: wire bytes to object; *read*: decode, then read every field. "Frame by
hand" is Q.link's frame written for the benchmark with `crc_hqx` and `bytes.replace`, for peers without
frames; pymavlink and "frame too" make and check their own."""


def generated_response() -> Peer:
    names = {
        "Message": qlink.MotionResponse,
        "ready": qlink.MotionResponse(node=messages.NODE, **messages.RESPONSE._asdict()),
        "decode_response": qlink.decode_response,
        "wire": messages.RESPONSE_WIRE,
    }
    return Peer(
        "generated Python",
        names,
        encode="ready.to_frame()",
        build=f"Message(node=3, {KEYWORDS}).to_frame()",
        decode="decode_response(wire)",
        read=f"m = decode_response(wire); m.node, {READ_FIELDS}",
    )


def by_hand() -> Peer:
    """Without an object: the cost of the frame if the fields stay a tuple."""
    names = {
        "pack": messages.RESPONSE_STRUCT.pack,
        "unpack": messages.RESPONSE_STRUCT.unpack,
        "values": tuple(messages.RESPONSE),
        "wire": messages.RESPONSE_WIRE,
        "wrap": messages.wrap,
        "unwrap": messages.unwrap,
    }
    return Peer(
        "struct, frame by hand, no object",
        names,
        encode="wrap(32, 3, pack(*values))",
        build=f"wrap(32, 3, pack{tuple(messages.RESPONSE)})",
        decode="unpack(unwrap(wire)[2])",
        read="a, b, c, d, e = unpack(unwrap(wire)[2])",
    )


def raw_cases() -> list[Case]:
    names = {
        "pack": messages.RESPONSE_STRUCT.pack,
        "unpack": messages.RESPONSE_STRUCT.unpack,
        "data": messages.RESPONSE_DATA,
    }
    values = ", ".join(map(str, messages.RESPONSE))
    return [Case(PACK, f"pack({values})", names), Case(UNPACK, "unpack(data)", names)]


def _cases(peer: Peer) -> list[Case]:
    return [Case(f"{peer.name}/{work}", getattr(peer, work), peer.names) for work in WORK]


def _row(peer: Peer, timings: dict[str, Timing]) -> list[str]:
    cells = [peer.name]
    for work in WORK:
        base = timings[PACK if work in ("encode", "build") else UNPACK]
        cells.append(number(timings[f"{peer.name}/{work}"].over(base)))
    return cells


def section(rounds: int) -> Section:
    """Every peer and all four kinds of work, in one interleaved run."""
    result = Section(
        "motion.response in Python, over raw struct", INTRO, ["", "encode", "build", "decode", "read"]
    )
    peers = [generated_response(), by_hand(), *available(result.missing)]
    timings = measure([*raw_cases(), *(case for peer in peers for case in _cases(peer))], rounds)
    result.rows = [_row(peer, timings) for peer in peers]
    result.rows.append(_nanoseconds(timings))
    result.goals = _goals(peers, timings)
    return result


def _nanoseconds(timings: dict[str, Timing]) -> list[str]:
    pack, unpack = (f"{timings[raw].best * 1e9:.0f} ns" for raw in (PACK, UNPACK))
    return ["one raw pack, one raw unpack, here", pack, "", unpack, ""]


def _goals(peers: list[Peer], timings: dict[str, Timing]) -> list[Goal]:
    own = peers[0].name
    goals = [
        Goal("ready object to wire bytes", timings[f"{own}/encode"].over(timings[PACK]), 6, "x raw pack"),
        Goal("wire bytes to object", timings[f"{own}/decode"].over(timings[UNPACK]), 7, "x raw unpack"),
    ]
    for start, limit in (("pymavlink", 6), ("construct, compiled, frame too", 8)):
        for peer in peers:
            if peer.name.startswith(start):
                goals += _faster_than(peer.name, own, limit, timings)
    return goals


def _faster_than(peer: str, own: str, limit: float, timings: dict[str, Timing]) -> list[Goal]:
    return [
        Goal(
            f"{work} against {peer}",
            timings[f"{peer}/{work}"].over(timings[f"{own}/{work}"]),
            limit,
            "x faster",
            at_least=True,
        )
        for work in ("encode", "decode")
    ]
