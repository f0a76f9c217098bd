"""Random faults of a line: probabilities, extents and counts."""

from __future__ import annotations

import random
import re
from collections import deque
from collections.abc import Callable, Mapping, Sequence

from qlinkgen.sim.errors import FaultPlanError
from qlinkgen.sim.fault_kinds import KINDS, Rate, RateLike, format_rate, make_rate
from qlinkgen.sim.fault_record import TO_MASTER, TO_SLAVES, Direction, Disturbed, FaultCounts, Injected
from qlinkgen.sim.fault_text import parse_parts

__all__ = ["KINDS", "TO_MASTER", "TO_SLAVES", "Disturbed", "FaultCounts", "FaultPlan", "Injected", "Rate"]

# Largest delay of separate noise after its transmission, in seconds.
_ALONE_WITHIN = 0.01
# Number of recent answers from which a stray frame is chosen.
_REMEMBERED = 64
_SETTINGS = ("seed", "to")
_DIRECTIONS = {"both": (TO_SLAVES, TO_MASTER), "slaves": (TO_SLAVES,), "master": (TO_MASTER,)}


class _Side:
    """The probabilities in one direction, with a table to draw all of them by one number in most cases.

    Attributes:
        any: probability of at least one fault.
        table: (kind, its probability, the probability of it or any later kind).
    """

    __slots__ = ("any", "counts", "direction", "table")

    def __init__(self, direction: Direction, rates: Mapping[str, Rate], counts: dict[str, int]) -> None:
        self.direction = direction
        self.counts = counts
        self.any = 0.0
        self.table: list[tuple[str, float, float]] = []
        for name, rate in reversed(list(rates.items())):
            if rate.chance and (direction == TO_MASTER or not KINDS[name].slaves_only):
                self.any = rate.chance + (1 - rate.chance) * self.any
                self.table.insert(0, (name, rate.chance, self.any))


class FaultPlan:
    """Random faults, each kind with its own probability per transmission, drawn independently.

    Every plan has its own random numbers: the same seed and the same traffic give the same faults, bit for
    bit. A plan belongs to one line; `FaultPlan.parse(str(plan))` makes an equal one.

    Attributes:
        rates: `Rate` of each kind.
        seed: seed of the random numbers.
        to: direction of the faults, "both", "slaves" or "master".
        counts: faults injected so far. Faults without effect are not counted: a dropped transmission is not
            damaged as well, a single byte is not truncated, and a stray needs an earlier answer.
        log: every `Injected` fault if `keep_log` was set, else None.
    """

    def __init__(
        self,
        *,
        drop: RateLike = 0.0,
        flip: RateLike = 0.0,
        truncate: RateLike = 0.0,
        delay: RateLike = 0.0,
        late: RateLike = 0.0,
        duplicate: RateLike = 0.0,
        stray: RateLike = 0.0,
        noise: RateLike = 0.0,
        silent: RateLike = 0.0,
        to: str = "both",
        seed: int = 0,
        strays: Callable[[random.Random], bytes] | Sequence[bytes] = (),
        keep_log: bool = False,
    ) -> None:
        """Make a plan. Each kind has a probability from 0 to 1, or (probability, low, high) with its extent.

        Args:
            drop: nothing arrives.
            flip: 1 to 3 bits arrive changed; the extent is in bits.
            truncate: the tail is missing, in one case of four the head.
            delay: delay of up to 0.1 ms; the extent is in seconds.
            late: a slave answers 0.05 to 0.2 s late, with its next transmissions after that; seconds.
            duplicate: repetition after a gap of up to 1 ms; seconds.
            stray: an unsolicited valid frame before or after the transmission.
            noise: 1 to 20 random bytes before it, after it, or alone within the next 10 ms; the extent is
                in bytes.
            silent: from this answer on the slave sends nothing for 0.1 to 1 s; seconds.
            to: "both", or only transmissions to the "slaves" or to the "master".
            seed: seed of the random numbers.
            strays: frames to choose strays from, or a function that makes one from a random.Random; by
                default the latest answers of all slaves.
            keep_log: keep every fault in `log`.

        Raises:
            FaultPlanError: a probability, an extent or a direction is invalid.
        """
        given = (drop, flip, truncate, delay, late, duplicate, stray, noise, silent)
        self.rates = {name: make_rate(name, rate) for name, rate in zip(KINDS, given, strict=True)}
        if to not in _DIRECTIONS:
            raise FaultPlanError(f"to must be one of {', '.join(_DIRECTIONS)}, not {to!r}")
        self.to = to
        self.seed = seed
        self.counts = FaultCounts()
        self.log: list[Injected] | None = [] if keep_log else None
        none: dict[str, Rate] = {}
        self._to_slaves = _Side(
            TO_SLAVES, self.rates if TO_SLAVES in _DIRECTIONS[to] else none, self.counts.to_slaves
        )
        self._to_master = _Side(
            TO_MASTER, self.rates if TO_MASTER in _DIRECTIONS[to] else none, self.counts.to_master
        )
        self._random = random.Random(seed)
        self._strays: Callable[[random.Random], bytes] | Sequence[bytes] = strays or deque(maxlen=_REMEMBERED)
        self._remember = (
            self._strays if isinstance(self._strays, deque) and self.rates["stray"].chance else None
        )
        self._silent_until: dict[str, float] = {}

    @classmethod
    def parse(cls, text: str) -> FaultPlan:
        """Parse a text such as `drop=0.01,flip=0.02,late=0.01:0.05-0.2,seed=3`.

        A part is a kind with its probability and, after a colon, the bounds of its extent. `all=0.05` spreads
        5 % evenly over every kind not listed. `seed=3` and `to=master` are settings.

        Raises:
            FaultPlanError: a part is invalid.
        """
        rates, settings = parse_parts(text, _SETTINGS)
        seed = settings.get("seed", "0")
        if not re.fullmatch(r"[-+]?\d+", seed):
            raise FaultPlanError(f"seed={seed}: not an integer; write for example seed=3")
        return cls(**rates, to=settings.get("to", "both"), seed=int(seed))  # type: ignore[arg-type]

    def __str__(self) -> str:
        """Return the text from which this plan is parsed, without `strays` and `keep_log`."""
        parts = [format_rate(name, rate) for name, rate in self.rates.items() if rate.chance]
        if self.to != "both":
            parts.append(f"to={self.to}")
        return ",".join([*parts, f"seed={self.seed}"])

    def __repr__(self) -> str:
        return f"FaultPlan({str(self)!r})"

    def disturb(self, data: bytes, now: float, source: str, *, to_master: bool) -> Disturbed | None:
        """Return the disturbed transmission, None if it is not disturbed. For use by the line only."""
        side = self._to_master if to_master else self._to_slaves
        what = None
        if self._silent_until and self._silent_until.get(source, now) > now:
            self.counts.silenced += 1
            what = Disturbed(b"")
        elif self._random.random() < side.any:
            what = self._disturb(data, now, source, side)
        if to_master and self._remember is not None:
            self._remember.append(data)
        return what

    def _disturb(self, data: bytes, now: float, source: str, side: _Side) -> Disturbed:
        hit = self._draw(side)
        if "silent" in hit:
            self._silent_until[source] = now + self._extent("silent")
            self.counts.silenced += 1
            self._record(side, now, "silent", data)
            return Disturbed(b"")
        before, after = self._extras(hit, now, side)
        if "drop" in hit:
            self._record(side, now, "drop", data)
            return Disturbed(b"", len(data), before=before, after=after)
        lead, tail = self._cut(data) if "truncate" in hit and len(data) > 1 else (0, 0)
        if lead or tail:
            data = data[lead : len(data) - tail]
            self._record(side, now, "truncate", data)
        if "flip" in hit:
            data = self._flip(data)
            self._record(side, now, "flip", data)
        wait = 0.0
        for kind in ("delay", "late"):
            if kind in hit:
                wait += self._extent(kind)
                self._record(side, now, kind, data)
        again = None
        if "duplicate" in hit:
            again = self._extent("duplicate")
            self._record(side, now, "duplicate", data)
        return Disturbed(data, lead, tail, wait, again, before, after)

    def _draw(self, side: _Side) -> set[str]:
        # At least one fault happens; up to the first hit, probabilities are conditional on that: 1 for the
        # last kind.
        hit: set[str] = set()
        for name, chance, this_or_later in side.table:
            if self._random.random() < (chance if hit else chance / this_or_later):
                hit.add(name)
        return hit

    def _extras(
        self, hit: set[str], now: float, side: _Side
    ) -> tuple[list[bytes], list[tuple[float, bytes]]]:
        before: list[bytes] = []
        after: list[tuple[float, bytes]] = []
        chance = self._random
        if "stray" in hit and (frame := self._stray()):
            self._record(side, now, "stray", frame)
            if chance.random() < 0.5:
                before.append(frame)
            else:
                after.append((0.0, frame))
        if "noise" in hit:
            noise = chance.randbytes(int(self._extent("noise")))
            self._record(side, now, "noise", noise)
            place = chance.randrange(3)
            if place == 0:
                before.append(noise)
            else:
                after.append((0.0 if place == 1 else chance.uniform(0, _ALONE_WITHIN), noise))
        return before, after

    def _stray(self) -> bytes:
        if callable(self._strays):
            return self._strays(self._random)
        return self._random.choice(self._strays) if self._strays else b""

    def _cut(self, data: bytes) -> tuple[int, int]:
        lost = self._random.randint(1, len(data) - 1)
        return (lost, 0) if self._random.random() < 0.25 else (0, lost)

    def _flip(self, data: bytes) -> bytes:
        out = bytearray(data)
        count = min(int(self._extent("flip")), 8 * len(out))
        for bit in self._random.sample(range(8 * len(out)), count):
            out[bit // 8] ^= 1 << bit % 8
        return bytes(out)

    def _extent(self, name: str) -> float:
        rate = self.rates[name]
        if KINDS[name].whole:
            return self._random.randint(int(rate.low), int(rate.high))
        return self._random.uniform(rate.low, rate.high)

    def _record(self, side: _Side, now: float, kind: str, data: bytes) -> None:
        side.counts[kind] += 1
        if self.log is not None:
            self.log.append(Injected(now, kind, side.direction, data))
