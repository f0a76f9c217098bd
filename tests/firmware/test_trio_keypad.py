"""The Trio keypad of the example firmware with a Motion Coordinator, compared with the keypad in Python.

Its display and counters are read by variables that a real keypad ignores (trio_keypad/diagnostics.h).
"""

from __future__ import annotations

import contextlib
import itertools
import random
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from decimal import Decimal

import pytest

from examples.trio_two_keypads import FIRST, LENGTH, SECOND, Machine
from qlinkgen.codecs import trio
from qlinkgen.link.ring import PATIENCE
from qlinkgen.protocols.trio import CURSOR, MotionCoordinator
from qlinkgen.protocols.trio.display import COLUMNS, ROWS, Display
from qlinkgen.protocols.trio.facts import KEY_UP, LAST_VARIABLE, MOST_NODES
from qlinkgen.protocols.trio.keypad_node import KeypadNode
from qlinkgen.sim.port_ring import PortRing
from qlinkgen.transport import Port, open_port
from tests.firmware.firmware import HANGS, Firmware
from tests.firmware.fixtures import BuildFirmware

TARGETS = ("posix", "lm3s6965evb")
#: Option for diagnostics.
DIAGNOSTIC = "-DKEYPAD_DIAGNOSTICS=1"
#: Options of the program: its timeout is longer than the delays of a busy machine.
PATIENT = f"{DIAGNOSTIC} -DKEYPAD_PATIENCE=20000"
MESSAGES = 300
KEYPAD = 10  # the next node along the ring
#: Ends a message found broken after its head was forwarded.
CUT = b"\x80"

# trio_keypad/diagnostics.h
DIAGNOSTICS = 16000
PRESS, RELEASE, INPUTS, ROW, LOOK, RESTART = range(6)
LOOKS = (
    *("offset", "mode", "place", "cursor_visible", "display_ignored"),
    *("taken", "passed", "blocked", "cut_short", "frame_faults", "crc_faults"),
    *("early_keys", "early_messages", "lost_keys", "ignored", "overruns", "seconds"),
)


@dataclass
class Line:
    """A Motion Coordinator whose only other node is the keypad."""

    mc: MotionCoordinator

    def ask(self, operation: int, operand: int = 0, *, node: int = KEYPAD, answer: int = 1) -> None:
        """Send a diagnostic; the answer goes `answer` nodes along from the keypad."""
        self.mc.send(node, 1, DIAGNOSTICS + 16 * operation + answer, operand)

    def look(self, name: str, **where: int) -> int:
        """Return a counter or another value of the keypad."""
        number, vr = LOOKS.index(name), self.mc.vr
        vr[number] = -1
        self.ask(LOOK, number, **where)
        self.mc.wait_until(lambda: vr[number] != -1, HANGS)
        return int(vr[number])

    def rows(self, **where: int) -> list[str]:
        """Return the rows of the display, without trailing blanks."""
        found = []
        for row in range(ROWS):
            self.ask(ROW, row, **where)
            found.append("".join(chr(self.mc.get(4, HANGS)) for _ in range(COLUMNS)).rstrip())
        return found

    def keys(self, count: int) -> list[int]:
        return [self.mc.get(4, HANGS) for _ in range(count)]


@pytest.fixture(params=TARGETS)
def path(request: pytest.FixtureRequest, build_firmware: BuildFirmware) -> Iterator[str]:
    """A keypad that has just been switched on."""
    with Firmware(request.param, build_firmware(request.param, "trio_keypad", PATIENT)) as firmware:
        wake(firmware.path)
        yield firmware.path


@pytest.fixture
def line(path: str) -> Iterator[Line]:
    with MotionCoordinator.open(path, patience=HANGS) as mc:
        yield Line(mc)


def random_text(rng: random.Random, most: int = 30) -> str:
    """Text for a display: mostly printable characters, and all that move its cursor."""
    pieces = [chr(rng.randrange(128)) for _ in range(rng.randint(1, most))]
    if rng.random() < 0.5:
        pieces += CURSOR(rng.randrange(128)), rng.choice("\r\n\x0c\x0e")
    return "".join(pieces)[:most]


def test_the_display_and_the_keys(line: Line) -> None:
    rng, shown, mc = random.Random(1), Display(), line.mc
    mc.send(KEYPAD, 2, 10)
    for turn in range(MESSAGES):
        text = random_text(rng)
        mc.print_(KEYPAD, text, end="")
        shown.feed(text)
        key = rng.randrange(KEY_UP)
        line.ask(PRESS, key)
        line.ask(RELEASE, key)
        assert line.keys(1) == [key]
        if turn % 30 == 29:
            assert line.rows() == shown.lines
            assert line.look("place") == shown.place
    assert line.look("display_ignored") == shown.ignored
    assert line.look("cursor_visible") == shown.cursor_visible
    assert line.look("taken") == MESSAGES + 1
    assert line.look("overruns") == 0
    assert mc.netstat == 0


def test_key_up_is_sent_in_mode_on_off(line: Line) -> None:
    mc = line.mc
    mc.send(KEYPAD, 2, 10)
    for mode, expected in (
        (trio.KeypadModeEnum.ON_OFF, [5, 5 + KEY_UP]),
        (trio.KeypadModeEnum.ON_ONLY, [5]),
        (77, [5]),  # without a meaning and an effect
    ):
        mc.keypad_mode(KEYPAD, mode)
        for _ in range(3):
            line.ask(PRESS, 5)
            line.ask(RELEASE, 5)
            assert line.keys(len(expected)) == expected
    assert line.look("mode") == trio.KeypadModeEnum.ON_ONLY
    assert line.look("ignored") == 1
    assert not mc.key(4)


def test_keys_go_as_far_as_the_offset_says(path: str) -> None:
    with open_port(path) as port:
        for offset in range(1, MOST_NODES + 1):
            port.write(trio.KeypadOffset(address=1, offset=offset).to_frame() + diagnostic(PRESS, 13))
            expected = trio.CharacterTransfer(address=offset, characters="\r").to_frame()
            assert read(port, len(expected)) == expected


def test_keys_are_debounced_inputs(line: Line) -> None:
    mc = line.mc
    assert line.look("early_keys") == 0, "no key is pressed at the start"
    mc.send(KEYPAD, 2, 10)
    for lines, mode, expected in (
        (0x400000, trio.KeypadModeEnum.ON_ONLY, [22]),
        (0x400001, trio.KeypadModeEnum.ON_OFF, [0]),
        (0x800005, trio.KeypadModeEnum.ON_OFF, [2, 22 + KEY_UP, 23]),
        (0x800000, trio.KeypadModeEnum.ON_OFF, [0 + KEY_UP, 2 + KEY_UP]),
        (0, trio.KeypadModeEnum.ON_OFF, [23 + KEY_UP]),
    ):
        mc.keypad_mode(KEYPAD, mode)
        line.ask(INPUTS, lines)
        assert line.keys(len(expected)) == expected
    assert not mc.key(4)


def test_own_messages_wait_until_a_message_to_others_has_passed(path: str) -> None:
    text = trio.CharacterTransfer(address=3, characters="first").to_frame()
    passed = trio.CharacterTransfer(address=2, characters="first").to_frame()
    keys = [trio.CharacterTransfer(address=1, characters=chr(key)).to_frame() for key in range(5, 24)]
    with open_port(path) as port:
        port.write(trio.KeypadOffset(address=1, offset=1).to_frame())
        assert counted(port, "early_keys") == 0  # it answers, so it has looked at its keys once
        port.write(diagnostic(INPUTS, 0xFFFFE0))  # on QEMU the others are down from the start
        port.write(text[:-1])
        came = read(port, len(passed) - 1)
        time.sleep(0.05)  # the keys are detected by now, unless the machine is very busy
        came += port.read(0.0)
        port.write(text[-1:])
        came += read(port, len(passed) + len(b"".join(keys)) - len(came))
        before, found, behind = came.partition(passed)
        assert found == passed
        assert before + behind == b"".join(keys)


def test_before_its_offset_it_sends_nothing(line: Line) -> None:
    mc = line.mc
    for _ in range(2):
        mc.print_(KEYPAD, "lost", end="")
        mc.keypad_mode(KEYPAD, trio.KeypadModeEnum.ON_OFF)
        mc.send(KEYPAD, 1, 5, 1)
        mc.print_(11, "goes no further", end="")
        line.ask(PRESS, 1)
        assert [line.look(name) for name in ("early_messages", "early_keys", "blocked")] == [3, 1, 1]
        assert line.rows() == [""] * ROWS
        mc.send(KEYPAD, 2, 10)
        mc.print_(KEYPAD, "seen", end="")
        mc.send(KEYPAD, 1, 5, 1)
        mc.print_(11, "!", end="")
        assert line.keys(1) == [ord("!")]
        assert line.rows() == ["seen", "", "", ""]
        assert [line.look(name) for name in ("offset", "ignored", "mode", "taken")] == [1, 1, 0, 6]
        line.ask(RESTART)
    assert not mc.key(4)
    assert mc.netstat == 0


def test_a_message_to_others_goes_on_while_it_still_comes(path: str) -> None:
    rng = random.Random(2)
    with open_port(path) as port:
        port.write(trio.KeypadOffset(address=1, offset=1).to_frame())
        for turn in range(MESSAGES):
            address = 2 + turn % 14
            header = 0x80 | address << 3 | rng.randint(1, 7)
            payload = bytes(rng.randrange(128) for _ in range(rng.randrange(trio.MARKING.most + 1)))
            frame = bytes((header, *payload, 0x80 | address << 3))
            expected = bytes((header - 8, *payload, 0x80 | (address - 1) << 3))
            for at in range(3):  # a byte at a time, as long as that is cheap
                port.write(frame[at : at + 1])
                assert read(port, len(expected[at : at + 1])) == expected[at : at + 1]
            port.write(frame[3:])
            assert read(port, len(expected[3:])) == expected[3:]
        assert counted(port, "passed") == MESSAGES
        assert counted(port, "frame_faults") == 0


class NoisyPort(Port):
    """A port that writes noise before each message."""

    def __init__(self, port: Port, rng: random.Random) -> None:
        self.name, self.baud, self.capabilities = port.name, port.baud, port.capabilities
        self.written = bytearray()
        self.quiet = False
        self._port, self._rng = port, rng

    def write(self, data: bytes) -> None:
        whole = data if self.quiet else noise(self._rng) + data
        self.written += whole
        self._port.write(whole)

    def read(self, timeout: float) -> bytes:
        return self._port.read(timeout)

    def close(self) -> None:
        self._port.close()

    def fileno(self) -> int | None:
        return self._port.fileno()


def noise(rng: random.Random) -> bytes:
    """Bytes outside messages that do not damage those after them."""
    text = trio.CharacterTransfer(address=1, characters="wrong").to_frame()
    variable = trio.DirectVariableTransfer(address=1, number=3, value=Decimal(7)).to_frame()
    flipped = bytearray(variable)
    flipped[rng.randrange(1, len(variable) - 1)] ^= 1 << rng.randrange(7)
    return rng.choice(
        (
            b"",
            bytes(rng.randrange(128) for _ in range(rng.randint(1, 300))),
            bytes((0x80 | rng.randrange(16) << 3,)),
            text[: rng.randint(1, len(text) - 1)],
            text[:-1] + bytes((0x80 | rng.randint(2, 15) << 3,)),
            bytes(flipped),
            bytes((0x88 | rng.randint(5, 7), 1, 2, 0x88)),
            bytes((0x80 | rng.randint(1, 7), 1, 0x88)),
            text[:1] + b"x" * rng.randint(257, 600) + text[-1:],
            trio.KeypadOffset(address=1, offset=1).to_frame()[:1] + b"\x63\x88",
            text[:1].replace(b"\x89", b"\x91") + b"for us" + bytes((0x80 | 3 << 3,)),
        )
    )


def test_every_intact_message_arrives_in_spite_of_the_noise(path: str) -> None:
    rng, shown, judge = random.Random(3), Display(), KeypadNode()
    noisy = NoisyPort(open_port(path), random.Random(4))
    with MotionCoordinator(noisy, patience=HANGS) as mc:
        line = Line(mc)
        mc.send(KEYPAD, 2, 10)
        for _ in range(MESSAGES // 2):
            text = random_text(rng)
            mc.print_(KEYPAD, text, end="")
            shown.feed(text)
            key, past = rng.randrange(KEY_UP), chr(rng.randrange(KEY_UP, 128)) * rng.randint(1, 3)
            line.ask(PRESS, key)
            mc.print_(11, past, end="")  # past the keypad, and back to us
            assert sorted(line.keys(1 + len(past))) == [key, *map(ord, past)], "the order is open"
        assert line.rows() == shown.lines
        noisy.quiet = True
        frame_faults, crc_faults = line.look("frame_faults"), line.look("crc_faults")
    judged(judge, bytes(noisy.written))
    faults = judge.link.counters.faults
    assert crc_faults == faults.pop("crc") > 0
    assert frame_faults == sum(faults.values()) > MESSAGES // 2


def test_it_does_with_any_bytes_what_the_keypad_in_python_does(path: str) -> None:
    rng, judge = random.Random(5), KeypadNode()
    with open_port(path) as port:
        for turn in range(MESSAGES):
            data = damaged_messages(rng)
            if turn % 50 == 49:
                data += trio.KeypadOffset(address=1, offset=rng.randint(1, 15)).to_frame()
            port.write(data)
            expected = judged(judge, data)
            assert read(port, len(expected)) == expected
        # Ends any current message, and sets the state for the messages below.
        end = trio.KeypadOffset(address=1, offset=1).to_frame()
        port.write(end)
        left = judged(judge, end)
        assert read(port, len(left)) == left
        counters, faults = judge.link.counters, dict(judge.link.counters.faults)
        assert counted(port, "crc_faults") == faults.pop("crc")
        assert counted(port, "frame_faults") == sum(faults.values())
        for name in ("taken", "passed", "blocked", "cut_short"):
            assert counted(port, name) == getattr(counters, name) > 0, name
        for name in ("early_messages", "ignored"):
            assert counted(port, name) == getattr(judge.counters, name) > 0, name
        assert counted(port, "mode") == judge.mode
        assert counted(port, "display_ignored") == judge.display.ignored
        assert [shown_row(port, row) for row in range(ROWS)] == judge.display.lines


def judged(judge: KeypadNode, data: bytes) -> bytes:
    """Return the bytes forwarded by the keypad in Python, fed byte by byte as the firmware is."""
    for byte in data:
        judge.link.receive(bytes((byte,)), 0.0)
    return judge.link.bytes_to_send(0.0)


def damaged_messages(rng: random.Random) -> bytes:
    """Messages to and past the keypad, half of them with damage of every kind."""
    data = bytearray()
    for _ in range(rng.randint(1, 6)):
        frame = bytearray(random_message(rng).to_frame())
        if rng.random() < 0.5:
            at = rng.randrange(len(frame))
            kind = rng.randrange(5)
            if kind == 0:
                frame[at] ^= 1 << rng.randrange(8)
            elif kind == 1:
                del frame[at]
            elif kind == 2:
                frame.insert(at, rng.randrange(256))
            elif kind == 3:
                del frame[at:]
            else:
                frame[at:at] = bytes(rng.randrange(128) for _ in range(rng.choice((2, 256, 260))))
        data += frame
    return bytes(data)


def random_message(rng: random.Random) -> trio.Message:
    address = rng.choice((1, 1, rng.randint(2, 15)))
    kind = rng.randrange(10)
    if kind == 0:
        return trio.KeypadMode(address=address, mode=rng.choice((0, 127, 64)))
    if kind < 4:
        number, value = rng.randrange(LAST_VARIABLE + 1), Decimal(rng.randint(-(2**31), 2**31 - 1))
        return trio.DirectVariableTransfer(address=address, number=number, value=value)
    return trio.CharacterTransfer(address=address, characters=random_text(rng))


def test_silence_ends_a_message(build_firmware: BuildFirmware) -> None:
    text = trio.CharacterTransfer(address=3, characters="never ends").to_frame()
    passed = trio.CharacterTransfer(address=2, characters="never ends").to_frame()
    with (
        Firmware("posix", build_firmware("posix", "trio_keypad", DIAGNOSTIC)) as firmware,
        open_port(firmware.path) as port,
    ):
        port.write(trio.KeypadOffset(address=1, offset=1).to_frame())
        for _ in range(2):
            begun = time.monotonic()
            port.write(text[:-1])
            assert read(port, len(text)) == passed[:-1] + CUT
            assert time.monotonic() - begun > PATIENCE - 0.003, "the board counts whole milliseconds"
            port.write(text[-1:] + text)
            assert read(port, len(text)) == passed
        assert counted(port, "frame_faults") == 2
        assert counted(port, "cut_short") == 2


def test_without_diagnostics_it_is_an_ordinary_keypad(build_firmware: BuildFirmware) -> None:
    program = build_firmware("posix", "trio_keypad")
    text = trio.CharacterTransfer(address=2, characters="through").to_frame()
    with Firmware("posix", program) as firmware, open_port(firmware.path) as port:
        port.write(trio.KeypadOffset(address=1, offset=1).to_frame())
        port.write(diagnostic(PRESS, 13) + diagnostic(LOOK, 0) + diagnostic(RESTART) + text)
        assert read(port, len(text)) == trio.CharacterTransfer(address=1, characters="through").to_frame()


def test_the_two_keypads_of_the_document(build_firmware: BuildFirmware) -> None:
    with contextlib.ExitStack() as stack:
        paths = [
            stack.enter_context(Firmware(name, build_firmware(name, "trio_keypad", PATIENT))).path
            for name in TARGETS
        ]
        for path in paths:
            wake(path)
        ring = stack.enter_context(PortRing(["port", *map(open_port, paths)]))
        mc = stack.enter_context(MotionCoordinator.open(ring.paths[0], patience=HANGS))
        machine, line = Machine(mc), Line(mc)
        machine.start()
        places = {FIRST: 2, SECOND: 1}  # from there to the coordinator
        for node, key in ((FIRST, "1"), (FIRST, "5"), (SECOND, "0"), *[(SECOND, "+")] * 3, (FIRST, "-")):
            line.ask(PRESS, ord(key), node=node, answer=places[node])
            mc.wait_until(lambda: mc.key(3), HANGS)
            machine.read_key()
        assert round(mc.vr[LENGTH], 6) == 0.2
        for node, answer in places.items():
            assert line.rows(node=node, answer=answer) == ["SPEED:    150", "LENGTH:      0.2", "", ""]
            assert line.look("cursor_visible", node=node, answer=answer) == 0
        assert mc.netstat == 0


# At the port itself, without an engine.


def read(port: Port, size: int) -> bytes:
    """Read `size` bytes."""
    return collect(port, lambda data: len(data) >= size)


def collect(port: Port, enough: Callable[[bytes], bool]) -> bytes:
    data, limit = b"", time.monotonic() + HANGS
    while not enough(data):
        assert time.monotonic() < limit, f"nothing came behind {data!r}"
        data += port.read(0.1)
    return data


def diagnostic(operation: int, operand: int = 0) -> bytes:
    """The frame of a diagnostic with its answer to the coordinator."""
    number = DIAGNOSTICS + 16 * operation + 1
    return trio.DirectVariableTransfer(address=1, number=number, value=Decimal(operand)).to_frame()


def wake(path: str) -> None:
    """Wait until the UART of a keypad is set up and it answers; then restart it.

    Answers have the order of the requests: the one to the last request is the last.
    """
    heard, limit = trio.StreamDecoder(), time.monotonic() + HANGS
    with open_port(path) as port:
        for turn in itertools.cycle(range(len(LOOKS))):
            assert time.monotonic() < limit, "it never answered"
            port.write(diagnostic(LOOK, turn))
            answered = False
            while not answered and (data := port.read(0.2)):
                answered = any(getattr(event, "number", None) == turn for event in heard.feed(data))
            if answered:
                break
        port.write(diagnostic(RESTART))


def answer(port: Port, operation: int, operand: int) -> trio.Message:
    port.write(diagnostic(operation, operand))
    ends = trio.CharacterTransfer(address=1, characters=" ").to_frame()[-1:]
    return trio.decode(collect(port, lambda data: data.endswith(ends)))


def counted(port: Port, name: str) -> int:
    message = answer(port, LOOK, LOOKS.index(name))
    assert isinstance(message, trio.DirectVariableTransfer)
    return int(message.value)


def shown_row(port: Port, row: int) -> str:
    message = answer(port, ROW, row)
    assert isinstance(message, trio.CharacterTransfer)
    return message.characters.rstrip()
