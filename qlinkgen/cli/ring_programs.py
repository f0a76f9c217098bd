"""``qlinkgen simulate trio`` with programs and keys: their options, and the run."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from qlinkgen.cli.boundary import Failure
from qlinkgen.cli.ring_console import LOOK, Console
from qlinkgen.cli.simulating import say_port
from qlinkgen.cli.stopping import StopSignals
from qlinkgen.model.values import whole_number
from qlinkgen.protocols.trio.basic import Pointed, Program, parse
from qlinkgen.sim import SimulationError
from qlinkgen.sim.key_script import KeyScript
from qlinkgen.sim.virtual_ring import VirtualRing

if TYPE_CHECKING:
    from qlinkgen.sim.port_ring import RingBus

#: Seconds that simulated time goes on after the last key.
AFTER_KEYS = 10.0


def programs_of(
    options: Sequence[str], kinds: Sequence[str], pointed: Pointed | None
) -> Mapping[int, Program]:
    """Return the programs of ``--program N=FILE`` by address. Raises Failure, and BasicError."""
    if pointed and not options:
        raise Failure(f"--point-format {pointed}: no program prints; give --program, or omit it")
    return {
        at: parse(_text_of(option, file), file, pointed=pointed or "before")
        for at, (option, file) in _placed("--program", options, kinds, "coordinator").items()
    }


def _text_of(option: str, file: str) -> str:
    try:
        # A comment may be in any encoding; other characters that are not ASCII are refused with their place.
        return Path(file).read_text("utf-8", errors="replace")
    except OSError as error:
        raise Failure(f"--program {option}: cannot read {file}: {error.strerror}") from None


def scripts_of(options: Sequence[str], kinds: Sequence[str]) -> Mapping[int, KeyScript]:
    """Return the scripts of ``--keys N=KEYS`` by address. Raises Failure."""
    scripts = {}
    for at, (option, text) in _placed("--keys", options, kinds, "keypad").items():
        try:
            scripts[at] = KeyScript(text)
        except SimulationError as error:
            raise Failure(f"--keys {option}: {error}") from None
    return scripts


def _placed(
    name: str, options: Sequence[str], kinds: Sequence[str], kind: str
) -> Mapping[int, tuple[str, str]]:
    """Return option and value by address, for nodes of a kind."""
    placed: dict[int, tuple[str, str]] = {}
    for option in options:
        number, sign, value = option.partition("=")
        at = whole_number(number.strip())
        if at is None or not sign or not value:
            raise Failure(
                f"{name} {option}: write the address of a {kind} and a value, such as 1={value or 'x'}"
            )
        if not 1 <= at <= len(kinds):
            raise Failure(f"{name} {option}: the ring has the addresses 1 to {len(kinds)}; see --ring")
        if kinds[at - 1] != kind:
            raise Failure(f"{name} {option}: address {at} is a {kinds[at - 1]}; give the address of a {kind}")
        if at in placed:
            raise Failure(f"{name} {option}: address {at} has one already; give one of them")
        placed[at] = option, value
    return placed


def run_open(bus: RingBus, console: Console, *, link: str | None, what: str, seconds: float | None) -> None:
    """Run a ring with a port until a signal, or for a time."""
    start = bus.port.now()
    end = math.inf if seconds is None else start + seconds

    def look_for(typed: str, *, last: bool = False) -> Callable[[], None]:
        return lambda: console.look(bus.port.now(), typed, since=start, last=last)

    try:
        with StopSignals() as signals, console.keyboard as keyboard:
            say_port(bus.path, link, what)
            bus.start()
            while bus.running and not signals.stopped and bus.port.now() < end:
                bus.call(look_for(keyboard.read(LOOK)))
            bus.stop()
            look_for("", last=True)()
    finally:
        bus.close()


def run_closed(ring: VirtualRing, console: Console, *, what: str, seconds: float | None) -> None:
    """Run a ring without a port, until a signal or for a time.

    With a keyboard its time is the real one. Without, the time is simulated and passes at once: the run also
    ends when nothing more can happen, or `AFTER_KEYS` seconds after the last key.
    """
    with StopSignals() as signals, console.keyboard as keyboard:
        say_port(None, None, what)
        times = _real_times(seconds) if console.typing else _simulated_times(ring, console, seconds)
        for now in times:
            typed = keyboard.read(LOOK) if console.typing else ""
            ring.wire.advance(now)
            console.look(now, typed)
            if signals.stopped:
                break
        console.look(ring.now, "", last=True)


def _real_times(seconds: float | None) -> Iterator[float]:
    start = time.monotonic()
    while seconds is None or time.monotonic() - start < seconds:
        yield time.monotonic() - start


def _simulated_times(ring: VirtualRing, console: Console, seconds: float | None) -> Iterator[float]:
    step = 0
    while True:
        step += 1
        now = step * LOOK
        if seconds is not None:
            if now > seconds:
                yield seconds
                return
        elif now > console.latest_key + AFTER_KEYS or (step > 1 and _over(ring, console)):
            return
        yield now


def _over(ring: VirtualRing, console: Console) -> bool:
    """Whether nothing more can happen."""
    return ring.wire.next_timer() is None and not console.key_is_due
