"""The other end of a pty: a process that answers at once, with precomputed answers.

Started as `python -m benchmarks.wire_responder KIND`; the pty's master side is its standard input.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable

from qlinkgen.codecs import qlink

NODES = (1, 2, 3, 4)
#: Offsets of node and counter in a motion's frame; with these nodes no byte before them is stuffed.
NODE_AT, COUNTER_AT = 4, 5
#: Read 5 holding registers of device 1 from register 0, and an answer to that: 8 and 15 bytes.
MODBUS_REQUEST = bytes.fromhex("01 03 00 00 00 05 85 c9")
MODBUS_RESPONSE = bytes.fromhex("01 03 0a 00 01 00 02 00 03 00 04 00 05")

Answer = Callable[[bytes], bytes]


def motion_answers() -> dict[tuple[int, int], bytes]:
    """Answers of moving nodes with a free FIFO, by node and counter."""
    return {
        (node, counter): qlink.MotionResponse(
            node=node, counter=counter, inputs=0x12, position=-123456, motor_status=3, fifo_space=200
        ).to_frame()
        for node in NODES
        for counter in range(256)
    }


def _motion() -> Answer:
    frames = motion_answers()
    return lambda request: frames[request[NODE_AT], request[COUNTER_AT]]


def modbus_crc(data: bytes) -> bytes:
    """CRC-16/MODBUS, low byte first."""
    register = 0xFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0xA001 if register & 1 else 0)
    return register.to_bytes(2, "little")


def _modbus() -> Answer:
    response = MODBUS_RESPONSE + modbus_crc(MODBUS_RESPONSE)
    return lambda _request: response


KINDS: dict[str, Callable[[], Answer]] = {"motion": _motion, "modbus": _modbus}


def serve(answer: Answer, descriptor: int) -> None:
    """Answer every piece read: a client writes a request at once, and a pty delivers it in one piece."""
    while True:
        try:
            request = os.read(descriptor, 512)
        except OSError:  # the client has closed its side
            return
        os.write(descriptor, answer(request))


if __name__ == "__main__":
    serve(KINDS[sys.argv[1]](), sys.stdin.fileno())
