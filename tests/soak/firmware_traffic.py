"""The traffic to a firmware: a random mix of all requests, and other bytes that may be on a line."""

from __future__ import annotations

import random
from binascii import crc_hqx
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from qlinkgen.codecs import qlink
from qlinkgen.protocols.qlink import VirtualNode
from tests.soak.firmware_program import Loader

Kind = Literal["request", "corrupted", "malformed", "stray", "noise"]

REQUESTS = {name: command.request for name, command in qlink.COMMANDS.items()}
ANSWERS = [command.response for command in qlink.COMMANDS.values() if command.response is not None]
NODES = range(qlink.BUS.first_node or 1, (qlink.BUS.last_node or 0) + 1)
PREAMBLE = b"\xa5"
#: Weight of each command.
WEIGHTS = {
    "motion": 22, "node_program_load": 20, "node_setup": 4, "node_info": 4, "node_start": 3, "node_stop": 2,
    "node_sync": 6, "node_reset": 1, "motor_response_poll": 4, "motor_request": 4, "motor_position": 4,
    "clear_fifo": 3, "preset_motor_position": 4, "read": 6, "write": 6, "write_read": 6, "set_outputs": 4,
    "clear_outputs": 4, "loop_back": 4,
}  # fmt: skip
#: A command supported by every node of the soak: its answer shows that the node has read all bytes before it.
ALWAYS = "loop_back"
#: Chance of disturbances before a request, and their kinds.
DISTURBED = 0.3
DISTURBANCES: tuple[Kind, ...] = ("corrupted", "corrupted", "malformed", "stray", "noise")
#: Most disturbances in a row: no baud rate slows them down, and a receive buffer is small.
IN_A_ROW = 2


@dataclass(frozen=True)
class Unit:
    """Bytes sent at once, with kind and name."""

    kind: Kind
    name: str
    data: bytes

    def __str__(self) -> str:
        return f"{self.kind:9} {self.name:30} {self.data.hex(' ')}"


class Traffic:
    """Makes units for a node; reads only its number and counters, which a master knows too."""

    def __init__(self, chance: random.Random, program_size: int, *, delays: bool) -> None:
        """Begin with a node after power-up.

        Args:
            chance: source of random numbers.
            program_size: size of the node's program memory in bytes.
            delays: whether node_setup sets delays from input 1 to output 1; else they are always 0.
        """
        self.loader = Loader(chance, program_size)
        self._random = chance
        self._delays = delays
        self._names = [name for name, weight in WEIGHTS.items() for _ in range(weight)]
        self._spoilers: tuple[Callable[[bytearray], None], ...] = (
            self._flip, self._cut, self._double, self._lose, self._replace,
        )  # fmt: skip
        self._strays: tuple[Callable[[int], qlink.Message], ...] = (
            self._foreign_request,
            self._foreign_answer,
        )

    def request(self, node: VirtualNode, motion_counter: int | None) -> Unit:
        """Return an intact request to a node, with any command."""
        name = self._random.choice(self._names)
        if name == "motion":
            message = self._motion(node, motion_counter)
        elif name == "node_program_load":
            message = self.loader.request(node.number)
        elif name == "node_setup":
            message = self._setup(node.number)
        else:
            message = self._any(REQUESTS[name], node.number)
        return Unit("request", message.NAME, message.to_frame())

    def always(self, node: VirtualNode) -> Unit:
        """Return a request that every node answers in every state."""
        message = self._any(REQUESTS[ALWAYS], node.number)
        return Unit("request", message.NAME, message.to_frame())

    def disturbances(self, node: VirtualNode) -> list[Unit]:
        """Return the disturbances before a request: mostly none."""
        if self._random.random() >= DISTURBED:
            return []
        count = self._random.randint(1, IN_A_ROW)
        return [self._disturbance(self._random.choice(DISTURBANCES), node.number) for _ in range(count)]

    # Requests -----------------------------------------------------------------------------------------------

    def _motion(self, node: VirtualNode, last: int | None) -> qlink.Message:
        following = 0 if last is None else (last + 1) % 256
        counter = self._random.choice((following,) * 6 + (last or 0, self._byte()))
        count = self._random.choice((0, 1, 3, 12, min(12, node.path.space), min(12, node.path.space + 1)))
        words = [self._number(0, 0xFFFF) for _ in range(count)]
        return qlink.MotionRequest(node=node.number, counter=counter, outputs=self._byte(), segments=words)

    def _setup(self, node: int) -> qlink.Message:
        delays = [self._random.randrange(256) / 10 if self._delays else 0.0 for _ in range(2)]
        return qlink.NodeSetupRequest(
            node=self._random.choice((node, node, node, qlink.BUS.broadcast or 0)),
            node_number=self._random.choice(NODES),
            t1_delay=delays[0],
            t2_delay=delays[1],
            position_type=self._random.choice((0, 1, 2, self._byte())),
        )

    def _any(self, message: type[Any], node: int) -> Any:
        """Return a message with any legal values."""
        values: dict[str, Any] = {"node": node}
        for rule in message.RULES:
            if hasattr(rule, "ranges"):
                low, high = rule.ranges[0]
                if rule.name != "node" or not low <= node <= high:
                    values[rule.name] = self._number(low, high)
            elif hasattr(rule, "item"):
                count = self._random.randint(rule.fewest, rule.most)
                values[rule.name] = [self._number(*rule.item.ranges[0]) for _ in range(count)]
            elif hasattr(rule, "fewest"):
                values[rule.name] = self._bytes(rule.fewest, rule.most)
            else:
                values[rule.name] = self._random.randrange(256) / 10
        return message(**values)

    def _byte(self) -> int:
        return self._random.choice((0xA5, 0x00, self._random.randrange(256)))

    def _number(self, low: int, high: int) -> int:
        chance = self._random
        odd = int.from_bytes(bytes(self._byte() for _ in range(4)), "big") & (high - low)
        return chance.choice((low, high, odd + low if odd + low <= high else low, chance.randint(low, high)))

    def _bytes(self, fewest: int, most: int) -> bytes:
        return bytes(self._byte() for _ in range(self._random.randint(fewest, most)))

    # Everything else ----------------------------------------------------------------------------------------

    def _disturbance(self, kind: Kind, number: int) -> Unit:
        if kind == "noise":
            return Unit(kind, "", self._bytes(1, 20))
        if kind == "malformed":
            return self._malformed(number)
        if kind == "stray":
            message = self._random.choice(self._strays)(number)
            return Unit(kind, message.NAME, message.to_frame())
        return self._corrupted(number)

    def _corrupted(self, number: int) -> Unit:
        message = self._any(self._random.choice(list(REQUESTS.values())), number)
        spoiled = bytearray(message.to_frame())
        while self._is_nearly_whole(spoiled):
            spoiled = bytearray(message.to_frame())
            self._random.choice(self._spoilers)(spoiled)
        return Unit("corrupted", message.NAME, bytes(spoiled))

    @staticmethod
    def _is_nearly_whole(data: bytearray) -> bool:
        """Whether the A5 that begins the next frame completes it.

        A checksum that ends in A5 completes a frame before the inserted byte is received. Then a node may
        answer while the sender still sends; which of both answers it gives depends on time.
        """
        return any(
            isinstance(event, qlink.Message) for event in qlink.StreamDecoder("request").feed(data + PREAMBLE)
        )

    def _malformed(self, number: int) -> Unit:
        """A frame with a correct checksum and any contents: unknown commands, wrong sizes, wrong numbers."""
        known = [message.ID for message in REQUESTS.values()]
        command = self._random.choice((*known, self._byte()))
        node = self._random.choice((number, number, number, 0, self._byte()))
        body = bytes((command, node)) + self._bytes(0, 26)
        body = bytes((len(body) + 2,)) + body
        checked = body + crc_hqx(body, 0xFFFF).to_bytes(2, "big")
        return Unit("malformed", f"command {command:#04x}", b"\xa5\xa5" + checked.replace(b"\xa5", b"\xa5\0"))

    def _other(self, number: int) -> int:
        return self._random.choice([each for each in NODES if each != number])

    def _foreign_request(self, number: int) -> qlink.Message:
        message: qlink.Message = self._any(self._random.choice(list(REQUESTS.values())), self._other(number))
        return message

    def _foreign_answer(self, number: int) -> qlink.Message:
        message: qlink.Message = self._any(self._random.choice(ANSWERS), self._other(number))
        return message

    def _place(self, data: bytearray) -> int:
        return self._random.randrange(len(data))

    def _flip(self, data: bytearray) -> None:
        for _ in range(self._random.randint(1, 3)):
            data[self._place(data)] ^= 1 << self._random.randrange(8)

    def _cut(self, data: bytearray) -> None:
        place = self._random.randrange(1, len(data))
        if self._random.random() < 0.25:
            del data[:place]
        else:
            del data[place:]

    def _double(self, data: bytearray) -> None:
        place = self._place(data)
        data.insert(place, data[place])

    def _lose(self, data: bytearray) -> None:
        del data[self._place(data)]

    def _replace(self, data: bytearray) -> None:
        data[self._place(data)] = self._byte()
