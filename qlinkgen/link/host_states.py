"""States of a host, and what moves it from one to the next."""

from __future__ import annotations

from enum import StrEnum


class HostState(StrEnum):
    """States of a host."""

    IDLE = "idle"  #: no transaction
    READY = "ready"  #: a packet may be sent
    SELECTING = "selecting"  #: waiting for the answer to the context
    WAITING = "waiting"  #: waiting for the answer to the request
    GUARD = "guard"  #: out of step; waiting for a quiet line
    FILLING = "filling"  #: one byte was sent to complete a packet that the device may wait for
    PROVING = "proving"  #: the context and the proof are sent


class HostEvent(StrEnum):
    """Events that change the state of a host."""

    START = "start"  #: a request is given, in step
    START_LOST = "start out of step"  #: a request is given, out of step
    SELECT = "select"  #: the context is sent
    SENT = "sent"  #: the request is sent
    UNREAD = "sent unread"  #: the request is sent, and no answer is read
    ANSWERED = "answered"  #: the answer to the request was received
    CONFIRMED = "confirmed"  #: the answer to the context, or the last of the proof, was received
    LOST = "lost"  #: a wrong answer or none, with attempts or rounds left, or bytes before anything was sent
    FILL = "fill"  #: the line is quiet, and a byte is sent
    SILENT = "silent"  #: no answer to the byte, and not all are sent
    FILLED = "filled"  #: an answer to the byte, or silence after all of them
    FAIL = "fail"  #: no attempt or round is left, or the line did not become quiet in time
    ABORT = "abort"  #: the caller gives up


_S, _E = HostState, HostEvent

#: The state after an event, by state and event.
HOST_MOVES = {
    (_S.IDLE, _E.START): _S.READY,
    (_S.IDLE, _E.START_LOST): _S.GUARD,
    (_S.READY, _E.SELECT): _S.SELECTING,
    (_S.READY, _E.SENT): _S.WAITING,
    (_S.READY, _E.UNREAD): _S.IDLE,
    (_S.READY, _E.LOST): _S.GUARD,
    (_S.READY, _E.ABORT): _S.IDLE,
    (_S.SELECTING, _E.CONFIRMED): _S.READY,
    (_S.SELECTING, _E.LOST): _S.GUARD,
    (_S.SELECTING, _E.FAIL): _S.IDLE,
    (_S.SELECTING, _E.ABORT): _S.IDLE,
    (_S.WAITING, _E.ANSWERED): _S.IDLE,
    (_S.WAITING, _E.LOST): _S.GUARD,
    (_S.WAITING, _E.FAIL): _S.IDLE,
    (_S.WAITING, _E.ABORT): _S.IDLE,
    (_S.GUARD, _E.FILL): _S.FILLING,
    (_S.GUARD, _E.FAIL): _S.IDLE,
    (_S.GUARD, _E.ABORT): _S.IDLE,
    (_S.FILLING, _E.SILENT): _S.GUARD,
    (_S.FILLING, _E.FILLED): _S.PROVING,
    (_S.FILLING, _E.ABORT): _S.IDLE,
    (_S.PROVING, _E.CONFIRMED): _S.READY,
    (_S.PROVING, _E.LOST): _S.GUARD,
    (_S.PROVING, _E.FAIL): _S.IDLE,
    (_S.PROVING, _E.ABORT): _S.IDLE,
}
