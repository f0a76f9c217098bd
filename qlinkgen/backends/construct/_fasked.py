"""Answers that only their request tells apart."""

from __future__ import annotations

from typing import BinaryIO

from construct import (
    Construct,
    ConstructError,
    Container,
    RangeError,
    stream_read_entire,
)

from ._fields import Message, Values
from ._frames import Frame, FrameError


class Asked:
    """A request, and its answers in the order of trial."""

    def __init__(self, request: str, *answers: Message) -> None:
        self.request = request
        self.answers = answers


class Told(Construct):
    """The frames of a slave, some of which have the number of several answers.

    Parsed with ``request``, the frame that it answers, it is the first answer to that
    whose payload is valid; without, the message that carries all of them.
    """

    def __init__(
        self,
        frame: Frame,
        requests: Frame,
        *asked: Asked,
    ) -> None:
        super().__init__()
        self.frame = frame
        self.wrap = frame.wrap
        self.decided = frame.decided
        self.requests = requests
        self.asked = {each.request: each.answers for each in asked}
        others = {
            each.name: each for answers in self.asked.values() for each in answers
        }
        number = next(iter(others.values())).id
        self.carrier = frame.by_id[number].name
        self.by_name = frame.by_name | others
        frame.by_name = self.by_name

    def _build(
        self, obj: Values, stream: BinaryIO, context: Container, path: str
    ) -> Values:
        return self.frame._build(obj, stream, context, path)

    def _parse(self, stream: BinaryIO, context: Container, path: str) -> Container:
        wire = stream_read_entire(stream, path)
        found = self.frame.parse(wire)
        request = context._params.get("request", b"")
        if not request or found.message != self.carrier:
            return found
        faults = []
        data = self.frame.by_name[self.carrier].build(found.fields)
        for message in self.asked.get(self.requests.parse(request).message, ()):
            try:
                fields = message.parse(data, decided=self.frame.decided(message, found))
            except RangeError as error:
                faults.append(FrameError("length", f"{message.name}; {error}"))
            except FrameError as error:
                faults.append(error)
            except ConstructError as error:
                faults.append(FrameError("range", f"{message.name}; {error}"))
            else:
                return Container({**found, "message": message.name, "fields": fields})
        if faults:
            raise faults[0]
        return found
