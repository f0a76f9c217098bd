"""Keys of a membrane keypad by name, and scripts that press them."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Mapping

from qlinkgen.protocols.trio.facts import KEY_UP
from qlinkgen.protocols.trio.keypad_node import KeypadNode
from qlinkgen.sim.errors import SimulationError

#: Names of keys with the numbers that the programs of the document compare them with.
KEY_NAMES: Mapping[str, int] = {**{str(digit): digit for digit in range(10)},
                                "+": 10, "-": 11, "enter": 13, "start": 20}  # fmt: skip
#: Seconds between two keys.
PAUSE = 0.1

_SECONDS = re.compile(r"([0-9]{1,6}(?:\.[0-9]{1,6})?|\.[0-9]{1,6})s")
_NUMBER = re.compile(r"[0-9]{1,2}")


class KeyScript:
    """Keys to press on one keypad, with pauses.

    Attributes:
        due: time of the next key; None if there is none, or before the keypad has its offset.
        latest: time of the latest key that has been pressed or has a time.
    """

    def __init__(self, text: str) -> None:
        """Read a script such as ``1 5 0 enter 0.5s + 42``.

        Args:
            text: keys, by name or number 0-63, and pauses in seconds before the next key, with blanks between
                them. The first key is pressed when the keypad has its offset, others `PAUSE` after one
                another.

        Raises:
            SimulationError: a word is neither.
        """
        self.due: float | None = None
        self.latest = 0.0
        self._keys: deque[tuple[float, int]] = deque()
        pause = PAUSE
        for word in text.split():
            if (found := _SECONDS.fullmatch(word)) is not None:
                pause += float(found[1])
            else:
                self._keys.append((pause, _key(word)))
                pause = PAUSE

    def play(self, keypad: KeypadNode, now: float) -> None:
        """Press the keys that are due; none before the keypad has its offset."""
        if keypad.offset is None:
            self.due = None
            return
        if self.due is None and self._keys:
            self._set_due(now)
        while self.due is not None and now >= self.due:
            press(keypad, self._keys.popleft()[1], now)
            self._set_due(self.due)

    def _set_due(self, before: float) -> None:
        self.due = before + self._keys[0][0] if self._keys else None
        self.latest = before if self.due is None else self.due


def press(keypad: KeypadNode, key: int, now: float) -> None:
    """Press and release a key."""
    keypad.press(key, now)
    keypad.release(key, now)


def _key(word: str) -> int:
    key = KEY_NAMES.get(word.lower())
    if key is None and _NUMBER.fullmatch(word) and int(word) < KEY_UP:
        key = int(word)
    if key is None:
        raise SimulationError(
            f"'{word}' is neither a key nor a pause; write the number of a key, 0 to {KEY_UP - 1}, one of "
            f"{', '.join(name for name in KEY_NAMES if not name.isdigit())}, or seconds such as 0.5s"
        )
    return key
