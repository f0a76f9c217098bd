"""A membrane keypad as a node of the ring: its keys, its display, and what puts it into network mode."""

from __future__ import annotations

from typing import Unpack

from qlinkgen.codecs import trio
from qlinkgen.link.ring import RingNode
from qlinkgen.link.ring_events import Dropped
from qlinkgen.protocols.trio.display import COLUMNS, ROWS, Display
from qlinkgen.protocols.trio.facts import KEY_UP
from qlinkgen.protocols.trio.options import NodeOptions

_MODES = (trio.KeypadModeEnum.ON_ONLY, trio.KeypadModeEnum.ON_OFF)


class KeypadCounters:
    """What a keypad has dropped.

    Attributes:
        early_keys: key presses before it had its offset.
        early_messages: messages to it before it had its offset.
        lost_keys: key presses that found no room in the transmit buffer.
        ignored: messages that mean nothing to a keypad, such as variables, and unknown modes.
    """

    __slots__ = ("early_keys", "early_messages", "ignored", "lost_keys")

    def __init__(self) -> None:
        self.early_keys = 0
        self.early_messages = 0
        self.lost_keys = 0
        self.ignored = 0

    def __repr__(self) -> str:
        return f"KeypadCounters({', '.join(f'{n}={getattr(self, n)}' for n in self.__slots__)})"


class KeypadNode:
    """The behaviour of a membrane keypad.

    Until it is told its offset it is not in network mode: it sends nothing, neither keys nor the messages of
    others, and what is sent to it is lost. All of that is counted.

    Attributes:
        link: the engine: counters, events.
        display: what it shows.
        offset: nodes along the ring to which it sends its keys, None until it was told.
        mode: what it sends for a key.
        counters: what it has dropped.
    """

    kind = "keypad"

    def __init__(self, *, rows: int = ROWS, columns: int = COLUMNS, **options: Unpack[NodeOptions]) -> None:
        """Make a keypad that was just switched on; the other options are those of `RingNode`."""
        options.setdefault("codec", trio)
        self.link = RingNode(on_message=self._handle, **options)
        self.display = Display(rows, columns)
        self.counters = KeypadCounters()
        self.reset()

    def reset(self) -> None:
        """Be switched off and on: the offset, the mode and the display are lost."""
        self.link.reset()
        self.link.passes = False
        self.display.reset()
        self.offset: int | None = None
        self.mode: trio.KeypadModeEnum | int = trio.KeypadModeEnum.ON_ONLY

    def _handle(self, message: trio.Message, now: float) -> None:
        if isinstance(message, trio.KeypadOffset):
            self.offset = message.offset
            self.link.passes = True
        elif self.offset is None:
            self.counters.early_messages += 1
            text = "the keypad has no offset yet: send it one before anything else (SEND, type 2)"
            self.link.events.append(Dropped(now, message, text))
        elif isinstance(message, trio.CharacterTransfer):
            self.display.feed(message.characters)
        elif isinstance(message, trio.KeypadMode) and message.mode in _MODES:
            self.mode = message.mode
        else:
            self.counters.ignored += 1

    def press(self, key: int | str, now: float) -> bool:
        """Press a key; return whether its character goes to the ring.

        Args:
            key: number of the key, 0-63, which is the character that it sends; or that character.
            now: the time.

        Raises:
            ValueError: there is no such key.
        """
        return self._send(check_key(key), now)

    def release(self, key: int | str, now: float) -> bool:
        """Let a key go; in mode on_off that sends the key's character plus 64. Otherwise as `press`."""
        character = check_key(key) + KEY_UP
        return self.mode == trio.KeypadModeEnum.ON_OFF and self._send(character, now)

    def _send(self, character: int, now: float) -> bool:
        if self.offset is None:
            self.counters.early_keys += 1
            return False
        message = trio.CharacterTransfer(address=self.offset, characters=chr(character))
        sent = self.link.send(message, now)
        if not sent:
            self.counters.lost_keys += 1
            self.link.refuse(now)
        return sent


def check_key(key: int | str) -> int:
    """Return the number of a key if it is one; a digit or letter may be given as text."""
    code = ord(key) if isinstance(key, str) and len(key) == 1 else key
    if type(code) is not int or not 0 <= code < KEY_UP:
        raise ValueError(f"key: {key!r} was given; keys have the numbers 0 to {KEY_UP - 1}")
    return code
