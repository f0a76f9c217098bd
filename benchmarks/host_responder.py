"""The chip set's end of a pty: a process that answers at once, with precomputed answers.

Started as `python -m benchmarks.host_responder`; the pty's master side is its standard input.
"""

from __future__ import annotations

import sys

from benchmarks.wire_responder import serve
from qlinkgen.codecs import mc1231a

POSITION = -123456
VELOCITY = 2.75
REQUESTS = {
    "write": mc1231a.SetVelRequest(value=VELOCITY),
    "read": mc1231a.GetActlPosRequest(),
    "select": mc1231a.Set1Request(),
}
RESPONSES: dict[str, mc1231a.Response] = {
    "write": mc1231a.SetVelResponse(),
    "read": mc1231a.GetActlPosResponse(value=POSITION),
    "select": mc1231a.Set1Response(status=0x0300),
}
ANSWERS = {REQUESTS[name].to_frame(): RESPONSES[name].to_frame(REQUESTS[name]) for name in REQUESTS}

if __name__ == "__main__":
    serve(ANSWERS.__getitem__, sys.stdin.fileno())
