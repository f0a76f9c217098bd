"""A membrane keypad as a node of the ring: keys, display and network mode."""

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
    """Counts of dropped keys and messages.

    Attributes:
        early_keys: key presses before it had its offset.
        early_messages: messages to it before it had its offset.
        lost_keys: key presses lost because the transmit buffer was full.
        ignored: messages without a meaning for a keypad, such as variables, and unknown modes.
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

    Until it receives its offset it is not in network mode: it neither sends keys nor forwards messages, and
    messages to it are lost. All of these are counted.

    Attributes:
        link: the engine: counters, events.
        display: the display.
        offset: number of nodes along the ring to the receiver of its keys, None until it is received.
        mode: whether it sends keys pressed, or keys pressed and released.
        counters: counts of dropped keys and messages.
    """

    kind = "keypad"

    def __init__(self, *, rows: int = ROWS, columns: int = COLUMNS, **options: Unpack[NodeOptions]) -> None:
        """Make a keypad as just switched on; the other options are those of `RingNode`."""
        options.setdefault("codec", trio)
        self.link = RingNode(on_message=self._handle, **options)
        self.display = Display(rows, columns)
        self.counters = KeypadCounters()
        self.reset()

    def reset(self) -> None:
        """Switch off and on: offset, mode and display are lost."""
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
            text = "the keypad has no offset yet: send it first (SEND, type 2)"
            self.link.events.append(Dropped(now, message, text))
        elif isinstance(message, trio.CharacterTransfer):
            self.display.feed(message.characters)
        elif isinstance(message, trio.KeypadMode) and message.mode in _MODES:
            self.mode = message.mode
        else:
            self.counters.ignored += 1

    def press(self, key: int | str, now: float) -> bool:
        """Press a key; return whether its character is sent.

        Args:
            key: number of the key, 0-63, which is the character that it sends; or that character.
            now: the time.

        Raises:
            ValueError: the key is out of range.
        """
        return self._send(check_key(key), now)

    def release(self, key: int | str, now: float) -> bool:
        """Release a key; in mode on_off this sends the key's character plus 64. Otherwise like `press`."""
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
    """Return the number of a key after checking it; a digit or letter may be passed as text."""
    code = ord(key) if isinstance(key, str) and len(key) == 1 else key
    if type(code) is not int or not 0 <= code < KEY_UP:
        raise ValueError(f"key: {key!r} was given; keys have the numbers 0 to {KEY_UP - 1}")
    return code
