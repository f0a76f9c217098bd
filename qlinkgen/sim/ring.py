"""A discrete-event model of a ring: each node hears only the previous one.

It is the line of `wire.py` with other routes. The nodes are in the order in which they were attached; the
outside, with the program under test, is between the last one and the first. Without an outside the last node
is connected to the first.

Hop `i` is the fibre from place `i` to the next; the outside's place is the last. A `FaultPlan` on a hop
disturbs whole messages: it collects a message before forwarding it, so on a hop with a plan every message is
delayed by its own length. A hop without one forwards each byte immediately.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from qlinkgen.link.ring import RingCodec
from qlinkgen.sim.errors import SimulationError
from qlinkgen.sim.faults import FaultPlan
from qlinkgen.sim.traffic import Chunk, Engine, Route, Sender
from qlinkgen.sim.wire import LINE, Chunks, Wire

#: A plan for all hops, or plans by the number of the place before the hop.
Faults = FaultPlan | Mapping[int, FaultPlan] | None


class _Hop:
    """One fibre.

    Attributes:
        line: sender of bytes without a station, such as noise.
        held: bytes of an incomplete message.
    """

    __slots__ = ("held", "line")

    def __init__(self) -> None:
        self.line = Sender(LINE)
        self.held = b""


class RingWire(Wire):
    """The fibres of a ring, and the nodes at them.

    Attributes:
        lost: number of bytes sent to switched-off nodes.
    """

    def __init__(
        self,
        codec: RingCodec,
        *,
        baud: int | None = None,
        faults: Faults = None,
        chunks: Chunks | None = None,
        outside: bool = True,
    ) -> None:
        """Make a ring without nodes.

        Args:
            codec: the generated module of the protocol, for the boundaries of messages.
            baud: bits per second, or None: bytes arrive immediately.
            faults: a plan for all hops, or plans for some.
            chunks: see `Wire`; by default "byte" on a paced ring, else "frame".
            outside: add a place for the program under test.

        Raises:
            SimulationError: an argument is out of range.
        """
        self._marking = codec.MARKING
        self._most = codec.BUS.last_node or self._marking.address_mask
        self._plans: Mapping[int, FaultPlan] = faults if isinstance(faults, Mapping) else {}
        self._hops: dict[Sender, _Hop] = {}
        self._places: list[Sender] = []
        self._off: set[Sender] = set()
        self._has_outside = outside
        self.lost = 0
        super().__init__(
            baud=baud,
            bits_per_byte=codec.BUS.bits_per_byte,
            faults=faults if isinstance(faults, FaultPlan) else None,
            collisions=False,
            chunks=chunks or ("byte" if baud else "frame"),
        )

    # places

    def _connect(self) -> None:
        places = [*self._stations, *([self._outside] if self._has_outside else [])]
        for at, place in enumerate(places):
            after = places[(at + 1) % len(places)]
            hop = self._hops.setdefault(place, _Hop())
            for route in (place.route, hop.line.route):
                route.hearers = () if after is self._outside or after in self._off else (after,)
                route.outside = after is self._outside
                route.on_line = True
        self._places = places
        if len(places) > self._most:
            raise SimulationError(
                f"{len(places)} places, including the outside's; a ring has at most {self._most}"
            )

    def plan(self, hop: int) -> FaultPlan | None:
        """Return the fault plan of a hop."""
        return self._plans.get(hop, self.faults)

    def switch_off(self, engine: Engine) -> None:
        """Switch a node off: it neither receives nor sends, so the ring is open at its place.

        Raises:
            SimulationError: it is not on this ring.
        """
        station = self._station(engine)
        station.due = None
        self._off.add(station)
        self._connect()

    def switch_on(self, engine: Engine) -> None:
        """Switch a node on again. The caller has to reset its volatile state.

        Raises:
            SimulationError: it is not on this ring.
        """
        station = self._station(engine)
        self._off.discard(station)
        self._connect()
        self._watch(station)

    def _watch(self, station: Sender) -> None:
        if station not in self._off:
            super()._watch(station)

    def step(self, until: float) -> bool:
        """Advance to the next event, at most to `until`; return False if there is none before that.

        Raises:
            SimulationError: stations answer one another endlessly.
        """
        due = self.next_timer()
        if due is not None and due <= until:
            self.advance(max(due, self._now))
            return True
        if self._now < until < float("inf"):
            self.advance(until)
            return True
        return False

    @property
    def now(self) -> float:
        """The current time of the simulation."""
        return self._now

    # bytes on a hop

    def _send(self, station: Sender, data: bytes, now: float) -> None:
        if not station.route.hearers and not station.route.outside:
            self.lost += len(data)
        number = self._places.index(station) if self._plans else 0
        plan = self.plan(number)
        if plan is None:
            self._submit(now, Chunk(station.route, data))
            return
        for message in self._whole(self._hops[station], data):
            what = plan.disturb(message, now, station.name, to_master=True)
            if what is None:
                self._submit(now, Chunk(station.route, message))
            else:
                self._send_disturbed(station, None, now, what)

    def _whole(self, hop: _Hop, data: bytes) -> Iterator[bytes]:
        """Yield each complete message, and bytes before a header."""
        marking = self._marking
        for byte in data:
            if not byte & marking.marker:
                hop.held += bytes((byte,))
                continue
            is_end = byte >> marking.id_shift & marking.id_mask == marking.end
            if not is_end and hop.held:
                yield hop.held
                hop.held = b""
            hop.held += bytes((byte,))
            if is_end:
                yield hop.held
                hop.held = b""

    def _extra_route(self, sender: Sender) -> Route:
        return self._hops[sender].line.route
