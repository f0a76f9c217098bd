"""Makes what decodes a capture, from what the user tells of it."""

from __future__ import annotations

from types import ModuleType

from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.common import turned_message
from qlinkgen.cli.conversations import Answers, Conversation, PacketWire
from qlinkgen.cli.encode import asked, proving
from qlinkgen.cli.streams import Alone, Stream, open_stream
from qlinkgen.cli.traffic import Lane, Sides, Traffic
from qlinkgen.model.message import Direction
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan.framing import frame_plan


class Decoder:
    """Decodes captures of a protocol, as the user tells it."""

    def __init__(  # noqa: PLR0917  # one call, with the options of the command
        self,
        protocol: Protocol,
        codec: ModuleType,
        direction: Direction | None,
        request: str | None,
        name: str | None,
        baud: int | None,
    ) -> None:
        self._protocol, self._codec = protocol, codec
        self._direction, self._request, self._name = direction, request, name
        self._baud = baud
        self.traffic({}, exact=True)  # what the user tells fits the protocol

    def traffic(self, sides: Sides, *, exact: bool) -> Traffic:
        """Return what decodes a capture from its start."""
        alone = self._alone(exact=exact)
        return Traffic(self._protocol, self._codec, sides, exact=exact, alone=alone, baud=self._baud)

    def _alone(self, *, exact: bool) -> Lane | None:
        """Return what decodes all bytes alike; None where their directions may be found."""
        protocol, codec, request = self._protocol, self._codec, self._request
        if self._name is not None:
            message = turned_message(protocol, self._name)
            stream: Stream = Alone(codec, message.name, proving(protocol, codec, message, request))
            return Lane(stream, exact=exact, wire=lambda found: found.to_bytes())
        if frame_plan(protocol.frame).needs_request and self._direction != "request":
            if self._direction is None and request is None:
                both = Conversation(protocol, codec)
                return Lane(both, exact=exact, wire=PacketWire(protocol), hear=both.hear)
            told = asked(protocol, codec, request)
            return Lane(Answers(protocol, codec, told), exact=exact, wire=PacketWire(protocol, told))
        if self._direction and self._direction not in protocol.directions:
            raise Failure(
                f"{protocol.name} has neither requests nor responses; omit --direction {self._direction}"
            )
        if request is not None and (protocol.carrier is None or self._direction == "request"):
            raise Failure("--request requires responses that only their request tells apart; omit it")
        if self._direction is None and request is None:
            return None
        first = None if request is None else asked(protocol, codec, request)
        return Lane(open_stream(protocol, codec, self._direction, first), exact=exact)
