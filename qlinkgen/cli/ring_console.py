"""The operator of a simulated ring: keys from the keyboard or scripts, displays, errors of programs."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence

from qlinkgen.cli.keyboard import Keyboard
from qlinkgen.cli.keypad_screens import DrawnScreens, JsonScreens
from qlinkgen.cli.simulating import say
from qlinkgen.protocols.trio.basic import ProgrammedNode
from qlinkgen.protocols.trio.client import Node
from qlinkgen.protocols.trio.keypad_node import KeypadNode
from qlinkgen.sim.key_script import KEY_NAMES, KeyScript, press
from qlinkgen.sim.wire import Wire

#: Seconds between two looks.
LOOK = 0.02
#: Characters of the keyboard to numbers of keys.
_TYPED = {name: key for name, key in KEY_NAMES.items() if len(name) == 1} | {
    "\r": KEY_NAMES["enter"],
    "\n": KEY_NAMES["enter"],
    "s": KEY_NAMES["start"],
}
_KEYS = "keys: 0 to 9, + is 10, - is 11, Enter 13, s (START) 20; Tab: next keypad; Ctrl-C: end"


class Console:
    """What an operator does and sees. It belongs to the thread that runs the ring.

    Attributes:
        drawn: displays are drawn on a terminal.
        typing: keys can be typed: there is a terminal, and no scripts.
        keyboard: the keyboard.
    """

    def __init__(self, wire: Wire, nodes: Sequence[Node], scripts: Mapping[int, KeyScript]) -> None:
        """Take the nodes of a ring, whose addresses count from 1, and scripts by address."""
        self._wire = wire
        self._keypads = {at: node for at, node in enumerate(nodes, 1) if isinstance(node, KeypadNode)}
        self._programs = {at: node for at, node in enumerate(nodes, 1) if isinstance(node, ProgrammedNode)}
        self._scripts = scripts
        self._failed: set[int] = set()
        displays = {at: keypad.display for at, keypad in self._keypads.items()}
        self.drawn = drawn = bool(displays) and sys.stdout.isatty() and os.environ.get("TERM") != "dumb"
        self.typing = drawn and not scripts and sys.stdin.isatty() and sys.platform != "win32"
        self.keyboard = Keyboard(used=self.typing)
        self._screens: DrawnScreens | JsonScreens = (
            DrawnScreens(displays, min(displays), _KEYS if self.typing else "")
            if drawn
            else JsonScreens(displays)
        )

    @property
    def failed(self) -> bool:
        """Whether a program has ended with an error."""
        return bool(self._failed)

    @property
    def latest_key(self) -> float:
        """Time of the latest key of the scripts, which may be to come."""
        return max((script.latest for script in self._scripts.values()), default=0.0)

    @property
    def key_is_due(self) -> bool:
        """Whether a script has a key to press."""
        return any(script.due is not None for script in self._scripts.values())

    def look(self, now: float, typed: str, *, since: float = 0.0, last: bool = False) -> None:
        """Press keys, show displays, and tell of errors.

        Args:
            now: the time of the ring.
            typed: characters of the keyboard.
            since: the beginning, which the times shown count from.
            last: the ring has stopped.
        """
        for at, script in self._scripts.items():
            script.play(self._keypads[at], now)
            self._wire.wake(self._keypads[at].link)
        for character in typed:
            self._type(character, now)
        self._screens.show(now - since, last=last)
        for at, node in self._programs.items():
            if node.machine.failure is not None and at not in self._failed:
                self._failed.add(at)
                if isinstance(self._screens, DrawnScreens):
                    self._screens.leave()
                say(f"address {at}: {node.machine.failure}", None)

    def _type(self, character: str, now: float) -> None:
        screens = self._screens
        if not isinstance(screens, DrawnScreens):
            return
        if character == "\t":
            order = sorted(self._keypads)
            screens.chosen = order[(order.index(screens.chosen) + 1) % len(order)]
        elif (key := _TYPED.get(character)) is not None:
            keypad = self._keypads[screens.chosen]
            press(keypad, key, now)
            self._wire.wake(keypad.link)
