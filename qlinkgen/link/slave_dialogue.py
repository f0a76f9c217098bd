"""A dialogue as a slave leads it: the mirror of what its master does."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import Any, TypeAlias

from qlinkgen.link.codec import Command, Framed, Message
from qlinkgen.link.dialogue import Progress

#: What a node answers to one frame.
Answers: TypeAlias = Message | Sequence[Message] | None
#: Yields the answers to a frame, and gets the next frame of the master.
Handling = Generator[Answers, Any, Answers]  # Any: a message of the class of the step


class _Pending:
    """What a handler returns that answers later."""

    def __repr__(self) -> str:
        return "PENDING"


#: Returned by a handler that answers later, with `SlaveEngine.answer`.
PENDING: Any = _Pending()  # handlers return messages of their protocol


class Refusal(Exception):  # the outcome of a request, not an error of the program
    """Raised by a handler to answer with another reply than the response.

    Attributes:
        reply: message of a reply of the command, as the schema describes it.
    """

    def __init__(self, reply: Message) -> None:
        super().__init__(reply)
        self.reply = reply


class SlaveDialogue(Progress):
    """A dialogue that a master has begun.

    Attributes:
        request: its request.
        asked: the frame that may say the sizes of the response.
        until: time at which the slave no longer waits for the next frame, None without a limit.
        left: it is over.
    """

    __slots__ = ("_handling", "_heard_at", "asked", "left", "request", "until")

    def __init__(self, command: Command, request: Framed, handling: Handling | None) -> None:
        """Without ``handling``, the handler has given all answers to the request at once."""
        super().__init__(command)
        self._handling = handling
        self._heard_at = 0
        self.request = self.asked = request
        self.until: float | None = None
        self.left = False

    def awaits_turn(self, now: float) -> bool:
        """Whether a frame of the master is due, in time, that only its turn tells."""
        return not self.left and self.sends and self.is_turned and (self.until is None or now <= self.until)

    def begin(self) -> Answers:
        """Return the answers to the request."""
        return self._resume(None)

    def hears(self, message: Framed, now: float) -> bool:
        """Pass over a frame of the master; return whether it was due, in time."""
        if self.left or (self.until is not None and now > self.until):
            return False
        before = self.at
        if not self.take(message, sent=True):
            return False
        self._heard_at = before
        if type(message) is self._command.sized_by:
            self.asked = message
        self.until = None
        return True

    def answer_to(self, message: Framed) -> Answers:
        """Return the answers to a frame that was heard."""
        answers = self._resume(message)
        if self.ended:
            self.leave()
        return answers

    def _resume(self, message: Framed | None) -> Answers:
        if self._handling is None:
            return None
        try:
            return self._handling.send(message)
        except StopIteration as end:
            answers: Answers = end.value
            return answers
        except Refusal as refusal:
            return refusal.reply

    def check(self, answers: Sequence[Message]) -> None:
        """Pass over answers of the slave; another reply ends the dialogue, unless it asks to go on.

        Raises:
            ValueError: an answer is not due, and no reply of the command.
        """
        for each in answers:
            if self.take(each, sent=False):  # type: ignore[arg-type]  # messages of buses have frames
                continue
            reply = self._command.replies.get(type(each))
            if reply is None:
                due = self.due.__name__ if self.due and self.receives else "nothing"
                raise ValueError(f"{each.NAME} is not due in {self._command.name}: {due} is")
            meaning = reply.meaning(each)
            if meaning == "again":
                self._move(self._heard_at)
            elif meaning != "pending":
                self.leave()
        if self.ended:
            self.leave()

    def leave(self) -> None:
        """End the dialogue, and the handler with it."""
        self.left = True
        if self._handling is not None:
            self._handling.close()
