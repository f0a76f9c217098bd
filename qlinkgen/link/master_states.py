"""States of a master, and what moves it from one to the next."""

from __future__ import annotations

from enum import StrEnum


class MasterState(StrEnum):
    """States of a master."""

    IDLE = "idle"  #: no transaction
    PROBING = "probing"  #: two bytes are sent to detect an echo; once, if the echo is "auto"
    GUARD = "guard"  #: a request waits for a quiet line
    WAITING = "waiting"  #: waiting for the answer until the deadline
    TURN = "turn"  #: the next frame of a dialogue is to be sent


class MasterEvent(StrEnum):
    """Events that change the state of a master."""

    START = "start"  #: a request is given
    START_PROBE = "start with a probe"  #: a request is given, and it is not known whether the port echoes
    PROBED = "probed"  #: the probe was received, or was not in time
    SENT = "sent"  #: the request is sent
    UNANSWERED = "sent without a response"  #: the request is sent, and nothing answers it
    ANSWERED = "answered"  #: the answer was received, perhaps a refusal
    AGAIN = "again"  #: a reply asks for the request once more
    MORE = "more"  #: one of several answers was received, and not the last
    NEXT = "next"  #: a frame of a dialogue was received or sent, and the master sends the next one
    PENDING = "pending"  #: a reply announces the answer
    REPEAT = "repeat"  #: the deadline passed with attempts left
    FAIL = "fail"  #: the deadline of the last attempt passed, or the line did not become quiet in time
    ABORT = "abort"  #: the caller gives up


_S, _E = MasterState, MasterEvent

#: The state after an event, by state and event.
MASTER_MOVES = {
    (_S.IDLE, _E.START): _S.GUARD,
    (_S.IDLE, _E.START_PROBE): _S.PROBING,
    (_S.PROBING, _E.PROBED): _S.GUARD,
    (_S.PROBING, _E.FAIL): _S.IDLE,
    (_S.PROBING, _E.ABORT): _S.IDLE,
    (_S.GUARD, _E.SENT): _S.WAITING,
    (_S.GUARD, _E.UNANSWERED): _S.IDLE,
    (_S.GUARD, _E.NEXT): _S.TURN,
    (_S.GUARD, _E.FAIL): _S.IDLE,
    (_S.GUARD, _E.ABORT): _S.IDLE,
    (_S.WAITING, _E.ANSWERED): _S.IDLE,
    (_S.WAITING, _E.AGAIN): _S.GUARD,
    (_S.WAITING, _E.MORE): _S.WAITING,
    (_S.WAITING, _E.NEXT): _S.TURN,
    (_S.WAITING, _E.PENDING): _S.WAITING,
    (_S.WAITING, _E.REPEAT): _S.GUARD,
    (_S.WAITING, _E.FAIL): _S.IDLE,
    (_S.WAITING, _E.ABORT): _S.IDLE,
    (_S.TURN, _E.SENT): _S.WAITING,
    (_S.TURN, _E.UNANSWERED): _S.IDLE,
    (_S.TURN, _E.NEXT): _S.TURN,
    (_S.TURN, _E.FAIL): _S.IDLE,
    (_S.TURN, _E.ABORT): _S.IDLE,
}
