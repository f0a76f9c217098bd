"""A stream of frames in pieces of 1 to 64 bytes, as read from a serial port."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from benchmarks import messages
from benchmarks.bytewise import BytewiseReceiver
from benchmarks.measure import Case, Timing, measure
from benchmarks.peer import PeerMissing
from benchmarks.peers_generated import mavlink_dialect
from benchmarks.python_codec import UNPACK, raw_cases
from benchmarks.report import Goal, Section, number
from qlinkgen.codecs import qlink

FRAMES = 300
LIMIT_MB_PER_SECOND = 15.0
REFERENCE_UNPACK = 100e-9  # of the machine in the goal

INTRO = """\
Messages are returned as objects with every field, frames checked, faults reported. The ratio is the time
for 16 bytes of stream (one motion.response, if nothing is stuffed; for pymavlink one of its frames) over
one raw unpack; MB/s is that ratio on a machine with a raw unpack of 100 ns. *motion*: counters and
positions of moving axes; *anything*: random fields, more A5; *noise*: stray bytes between the frames and
corrupted frames."""

Feed = Callable[[bytes], Any]


def run(decoder: Callable[[], Feed], pieces: Sequence[bytes]) -> None:
    feed = decoder()
    for piece in pieces:
        feed(piece)


def generated() -> Feed:
    feed: Feed = qlink.StreamDecoder("response").feed
    return feed


def bytewise() -> Feed:
    return BytewiseReceiver().feed


def _qlink_streams() -> dict[str, bytes]:
    motion = [_wire(i, fields) for i, fields in enumerate(messages.motion(FRAMES))]
    anything = [_wire(i, fields) for i, fields in enumerate(messages.anything(FRAMES))]
    return {
        "motion": b"".join(motion),
        "anything": b"".join(anything),
        "motion with noise": messages.noisy(motion),
    }


def _wire(i: int, fields: messages.ResponseFields) -> bytes:
    return messages.wrap(messages.MOTION, i % 16 + 1, messages.RESPONSE_STRUCT.pack(*fields))


def _case(name: str, decoder: Callable[[], Feed], stream: bytes, per_frame: float = 16) -> Case:
    names = {"run": run, "decoder": decoder, "pieces": messages.chunks(stream)}
    return Case(name, "run(decoder, pieces)", names, per=len(stream) / per_frame)


def _mavlink_case() -> Case:
    """Its own frames are 21 bytes with the same fields: the ratio is also per frame."""
    dialect = mavlink_dialect()
    sender = dialect.MAVLink(None, srcSystem=messages.NODE)
    frames = [
        bytes(dialect.MAVLink_motion_response_message(*fields).pack(sender))
        for fields in messages.motion(FRAMES)
    ]

    def decoder() -> Feed:
        link = dialect.MAVLink(None)
        link.robust_parsing = True  # noise is reported, not raised
        feed: Feed = link.parse_buffer
        return feed

    stream = b"".join(frames)
    return _case("pymavlink parse_buffer, motion", decoder, stream, per_frame=len(stream) / FRAMES)


def section(rounds: int) -> Section:
    """The generated decoder, a decoder that works byte by byte in Python, and pymavlink, interleaved."""
    result = Section("Stream decoder, pieces of 1 to 64 bytes", INTRO, ["", "x raw unpack", "MB/s at 100 ns"])
    streams = _qlink_streams()
    cases = [_case(f"generated Python, {kind}", generated, stream) for kind, stream in streams.items()]
    cases.append(_case("byte at a time in Python, motion", bytewise, streams["motion"]))
    try:
        cases.append(_mavlink_case())
    except PeerMissing as reason:
        result.missing.append(str(reason))
    timings = measure([*raw_cases(), *cases], rounds)
    result.rows = [_row(case.name, timings) for case in cases]
    result.goals = _goals(timings)
    return result


def _row(name: str, timings: dict[str, Timing]) -> list[str]:
    ratio = timings[name].over(timings[UNPACK])
    return [name, number(ratio), number(_megabytes(ratio))]


def _megabytes(ratio: float) -> float:
    return 16 / (ratio * REFERENCE_UNPACK) / 1e6


def _goals(timings: dict[str, Timing]) -> list[Goal]:
    ratio = timings["generated Python, motion"].over(timings[UNPACK])
    limit = 16 / (LIMIT_MB_PER_SECOND * 1e6 * REFERENCE_UNPACK)
    return [
        Goal("stream decoder, 16 bytes of stream", ratio, limit, "x raw unpack"),
        Goal(
            "the same as throughput, with a raw unpack of 100 ns",
            _megabytes(ratio),
            15,
            "MB/s",
            at_least=True,
        ),
    ]
