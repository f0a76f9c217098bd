"""Dialogues: transactions of several frames each way, in the order of the steps of their command."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, final

from qlinkgen.link.codec import Command, Framed, StepSpan
from qlinkgen.link.turn import Collected, Misread, has_turns, is_turned, steps_of

#: A later frame of a master: a message, or a function that makes it from the answers so far.
Further = Framed | Callable[[Sequence[Any]], Framed]  # Any: answers of several classes


@final
class Dialogue(NamedTuple):
    """A request of a command with steps, and what the master sends after it.

    The reply to it has a tuple of all answers.
    """

    request: Framed
    #: A message for each step that the master sends, or a function that makes it from the answers so far.
    further: Sequence[Further] = ()


class Progress:
    """A place in the steps of a command.

    Attributes:
        at: number of the frame that is due; the first one after the request is 0.
    """

    __slots__ = ("_collected", "_command", "_steps", "at")

    def __init__(self, command: Command) -> None:
        self._command = command
        self._steps = steps_of(command)
        self.at = 0
        #: The bytes so far of a frame that only its turn tells.
        self._collected: Collected | None = None

    @property
    def ended(self) -> bool:
        """No frame is due."""
        return self.at >= len(self._steps)

    @property
    def sends(self) -> bool:
        """A frame of the master is due."""
        return not self.ended and self._steps[self.at][0] == "send"

    @property
    def receives(self) -> bool:
        """A frame of the slave is due."""
        return not self.ended and self._steps[self.at][0] == "receive"

    @property
    def due(self) -> type[Framed] | None:
        """Class of the frame that is due, None after the last one."""
        return None if self.ended else self._steps[self.at][1]

    @property
    def is_turned(self) -> bool:
        """Only its turn tells the frame that is due."""
        return is_turned(self.due)

    def collect(self, byte: bytes, asked: Framed, wrong: type[Exception]) -> Framed | Misread | None:
        """Take the next byte of the frame that is due, see `Collected`."""
        if self._collected is None:
            kind = self.due
            assert is_turned(kind)
            self._collected = Collected(kind, self._command, asked)
        return self._collected.take(byte, wrong)

    @property
    def within(self) -> StepSpan | None:
        """Time limit of the frame that is due, None without one."""
        return None if self.ended else self._steps[self.at][2]

    @property
    def is_last_answer(self) -> bool:
        """The frame that is due is the last one of the slave."""
        return self.receives and all(who == "send" for who, _, _ in self._steps[self.at + 1 :])

    def take(self, message: Framed, *, sent: bool) -> bool:
        """Pass over a frame of the master or the slave; return whether it was due."""
        if self.ended or self.sends is not sent or type(message) is not self.due:
            return False
        self._move(self.at + 1)
        return True

    def _move(self, at: int) -> None:
        self.at = at
        self._collected = None


class Conversation(Progress):
    """A dialogue as a master leads it.

    Attributes:
        has_turns: only their turn tells some of its frames.
        is_alone: it is a request and its response, which only its turn tells.
        answers: the answers so far.
        sent: what the master has sent last.
    """

    __slots__ = ("_further", "_request", "_sends", "_sent_at", "answers", "has_turns", "is_alone", "sent")

    def __init__(self, command: Command, request: Framed, further: Sequence[Further]) -> None:
        """Check what the master is going to send.

        Raises:
            TypeError: a message is not that of its step.
            ValueError: there are more or fewer messages than steps.
        """
        super().__init__(command)
        kinds = [kind for who, kind, _ in command.steps if who == "send"]
        if len(further) != len(kinds):
            raise ValueError(
                f"{command.name} has {len(kinds)} frames after its request, not {len(further)}; "
                f"pass Dialogue(request, [...]) with a message or a function for each"
            )
        for given, kind in zip(further, kinds, strict=True):
            if not callable(given):
                _check(given, kind)
        self.has_turns = has_turns(command)
        self.is_alone = not command.steps
        self._further = further
        self._request = request
        self.restart()

    def restart(self) -> None:
        """Begin again at the request."""
        self._move(0)
        self.answers: list[Framed] = []
        self.sent = self._request
        self._sends = 0
        self._sent_at = (-1, 0)

    def answer(self, message: Framed) -> None:
        """Take an answer that is due."""
        self.answers.append(message)
        self._move(self.at + 1)

    def next(self) -> Framed:
        """Return the message that the master sends next; the place moves on."""
        given, kind = self._further[self._sends], self.due
        assert kind is not None
        self.sent = given(tuple(self.answers)) if callable(given) else given
        _check(self.sent, kind)
        self._sent_at = self.at, len(self.answers)
        self._sends += 1
        self._move(self.at + 1)
        return self.sent

    def back(self) -> bool:
        """Return to the last frame that the master sent after the request; False if there is none."""
        if not self._sends:
            return False
        at, known = self._sent_at
        self._move(at)
        del self.answers[known:]
        self._sends -= 1
        return True


def _check(message: Framed, kind: type[Framed]) -> None:
    if type(message) is not kind:
        raise TypeError(f"the next frame is {kind.__name__}, not {type(message).__name__}")
