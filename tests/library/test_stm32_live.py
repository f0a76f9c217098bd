"""The boot loader of the STM32: stm32loader leads our slave, and our master a device without our code."""

from __future__ import annotations

import functools
import operator
from typing import Any

import pytest
import serial

from qlinkgen.errors import Refused
from qlinkgen.link import Dialogue, MasterEngine, Monitor, Refusal, Timing
from qlinkgen.link.events import Damaged
from qlinkgen.link.monitor import Asked, Replied
from tests.bus.wires import codec_of
from tests.library.protocols import peer
from tests.library.test_live import PATIENCE, serving

#: The commands that the devices have; a checksum of the memory is not among them.
CODES = [0x00, 0x01, 0x02, 0x11, 0x21, 0x31, 0x43, 0x63, 0x73, 0x82, 0x92]
START = 0x08000000
PAGE = 1024


class Chip:
    """The memory of a device."""

    def __init__(self) -> None:
        self.memory = bytearray(range(256)) * 16
        self.started = 0
        self.protected: list[int] = []

    def has(self, start: int, size: int) -> bool:
        return START <= start <= START + len(self.memory) - size

    def read(self, start: int, size: int) -> bytes:
        return bytes(self.memory[start - START :][:size])

    def write(self, start: int, data: bytes) -> None:
        self.memory[start - START : start - START + len(data)] = data

    def erase(self, pages: list[int]) -> None:
        for page in pages:
            self.write(START + page * PAGE, b"\xff" * PAGE)


class Loader:
    """The handlers of a slave for a chip, of the generated messages."""

    number = 0  # frames have no address

    def __init__(self, codec: Any, chip: Chip, codes: list[int]) -> None:
        self._codec, self._chip, self._codes = codec, chip, codes
        self._ack = codec.Ack()

    def handle(self, request: Any, now: float) -> Any:
        return getattr(self, type(request).__name__.removesuffix("Request"))()

    def _placed(self, place: Any, size: int) -> Any:
        if not self._chip.has(place.start, size):
            raise Refusal(self._codec.Nack())
        return self._ack

    def Get(self) -> Any:  # noqa: N802  # like its message
        return [self._ack, self._codec.GetKnown(version=0x31, codes=self._codes), self._ack]

    def GetVersion(self) -> Any:  # noqa: N802
        return [self._ack, self._codec.GetVersionKnown(version=0x31, options=[0, 0]), self._ack]

    def GetId(self) -> Any:  # noqa: N802
        return [self._ack, self._codec.GetIdProduct(product=0x410), self._ack]

    def ReadMemory(self) -> Any:  # noqa: N802
        place = yield self._ack
        amount = yield self._placed(place, 1)
        data = self._chip.read(place.start, amount.count)
        return [self._ack, self._codec.ReadMemoryContent(data=data)]

    def WriteMemory(self) -> Any:  # noqa: N802
        place = yield self._ack
        block = yield self._placed(place, 4)
        self._chip.write(place.start, block.data)
        return self._ack

    def Go(self) -> Any:  # noqa: N802
        place = yield self._ack
        self._chip.started = place.start
        return self._ack

    def Erase(self) -> Any:  # noqa: N802
        listed = yield self._ack
        self._chip.erase(listed.pages)
        return self._ack

    ExtendedErase = Erase

    def WriteProtect(self) -> Any:  # noqa: N802
        listed = yield self._ack
        self._chip.protected = listed.sectors
        return self._ack

    def WriteUnprotect(self) -> Any:  # noqa: N802
        self._chip.protected = []
        return [self._ack, self._ack]

    ReadoutProtect = WriteUnprotect


@pytest.mark.parametrize("extended", [False, True])
def test_stm32loader_writes_and_reads_a_device(*, extended: bool) -> None:
    peer("stm32")
    from stm32loader.bootloader import CommandError, Stm32Bootloader

    chip, codec = Chip(), codec_of("stm32")
    codes = [0x44 if code == 0x43 and extended else code for code in CODES]
    with serving("stm32", Loader(codec, chip, codes)) as pty, serial.Serial(pty.path) as port:
        port.timeout = PATIENCE
        loader = Stm32Bootloader(port, verbosity=0)
        assert loader.get() == 0x31
        assert loader.extended_erase == extended
        assert loader.get_version() == 0x31
        assert loader.get_id() == 0x410
        assert loader.read_memory(START + 3, 256) == bytes((*range(3, 256), 0, 1, 2))
        assert loader.read_memory(START, 1) == b"\0"
        # Bytes like a command and an acknowledgement, at an address like a command.
        data = bytes.fromhex("11 EE 79 1F") * 64
        loader.write_memory(START + 0x100, data)
        assert loader.read_memory(START + 0x100, 256) == data
        loader.write_memory_data(START + PAGE, bytes(range(250)) * 3)
        assert chip.read(START + PAGE, 750) == bytes(range(250)) * 3
        loader.erase_memory([1, 2])
        assert chip.read(START + PAGE, 2 * PAGE) == b"\xff" * 2 * PAGE
        assert chip.read(START + 0x100, 256) == data
        with pytest.raises(CommandError, match="NACK"):
            loader.read_memory(0x1FFF0000, 4)
        loader.write_protect([0, 3])
        assert chip.protected == [0, 3]
        loader.write_unprotect()
        loader.readout_protect()
        loader.go(START + 0x20)
        assert chip.started == START + 0x20


class Device:
    """A boot loader that reads its bytes as the document says, and shares nothing with generated code."""

    def __init__(self, chip: Chip) -> None:
        self.chip = chip
        self._talk = self._talking()
        self._wanted = next(self._talk)
        self._held = b""

    def answer(self, data: bytes) -> bytes:
        """What it sends after these bytes."""
        sent = b""
        self._held += data
        while len(self._held) >= self._wanted:
            taken, self._held = self._held[: self._wanted], self._held[self._wanted :]
            found = self._talk.send(taken)
            while isinstance(found, bytes):
                sent += found
                found = next(self._talk)
            self._wanted = found
        return sent

    def _talking(self) -> Any:
        """Yields a number of bytes to get, or bytes to send."""
        while True:
            code, inverse = yield 2
            if code ^ inverse != 0xFF or code not in CODES:
                yield b"\x1f"
                continue
            yield b"\x79"
            yield from getattr(self, f"_{code:02x}")()

    def _00(self) -> Any:
        yield bytes((len(CODES), 0x22, *CODES)) + b"\x79"

    def _01(self) -> Any:
        yield b"\x22\x00\x00\x79"

    def _02(self) -> Any:
        yield b"\x01\x04\x10\x79"

    def _address(self) -> Any:
        found = yield 5
        start = int.from_bytes(found[:4], "big")
        right = functools.reduce(operator.xor, found) == 0 and self.chip.has(start, 1)
        yield b"\x79" if right else b"\x1f"
        return start if right else None

    def _11(self) -> Any:
        if (start := (yield from self._address())) is not None:
            number, _ = yield 2
            yield b"\x79" + self.chip.read(start, number + 1)

    def _31(self) -> Any:
        if (start := (yield from self._address())) is not None:
            (number,) = yield 1
            found = yield number + 2
            self.chip.write(start, found[:-1])
            yield b"\x79"

    def _43(self) -> Any:
        (number,) = yield 1
        found = yield number + 2
        self.chip.erase([*found[:-1]])
        yield b"\x79"

    def _82(self) -> Any:
        yield b"\x79"


class Port:
    """A line to a device, which a monitor hears; answers come in one piece."""

    def __init__(self, device: Device, monitor: Monitor) -> None:
        self._device, self._monitor, self._answers, self.time = device, monitor, b"", 0.0

    def write(self, data: bytes) -> None:
        self._monitor.receive(data, self.time)
        answers = self._device.answer(data)
        self._monitor.receive(answers, self.time)
        self._answers += answers

    def read(self) -> bytes:
        self.time += 0.001
        found, self._answers = self._answers, b""
        return found


def transact(engine: MasterEngine, port: Port, request: Any, *further: Any) -> Any:
    engine.start(Dialogue(request, further), port.time)
    while engine.busy:
        if data := engine.bytes_to_send(port.time):
            port.write(data)
        if found := port.read():
            engine.receive(found, port.time)
        engine.handle_timer(port.time)
    return engine.take().response


def test_our_master_writes_and_reads_a_device() -> None:
    codec = codec_of("stm32")
    chip, timing = Chip(), Timing.of(codec, host_slack=0.002)
    monitor = Monitor(codec, timing)
    port, engine = Port(Device(chip), monitor), MasterEngine(codec, timing)
    ask = functools.partial(transact, engine, port)
    _, known, _ = ask(codec.GetRequest())
    assert (known.version, known.codes) == (0x22, CODES)
    assert ask(codec.GetVersionRequest())[1].version == 0x22
    assert ask(codec.GetIdRequest())[1].product == 0x410
    *_, content = ask(
        codec.ReadMemoryRequest(), codec.ReadMemoryPlace(start=START + 3), codec.ReadMemoryAmount(count=256)
    )
    assert content.data == bytes((*range(3, 256), 0, 1, 2))
    data = bytes.fromhex("11 EE 79 1F 79")
    place = codec.WriteMemoryPlace(start=START)
    ask(codec.WriteMemoryRequest(), place, codec.WriteMemoryBlock(data=data))
    assert chip.read(START, 6) == data + b"\x05"
    *_, content = ask(
        codec.ReadMemoryRequest(), codec.ReadMemoryPlace(start=START), codec.ReadMemoryAmount(count=5)
    )
    assert content.data == data
    ask(codec.EraseRequest(), codec.ErasePages(pages=[3, 0]))
    assert chip.read(START, PAGE) == chip.read(START + 3 * PAGE, PAGE) == b"\xff" * PAGE
    ask(codec.ReadoutProtectRequest())
    with pytest.raises(Refused):
        ask(codec.ReadMemoryRequest(), codec.ReadMemoryPlace(start=0), codec.ReadMemoryAmount(count=5))
    with pytest.raises(Refused):
        ask(codec.ExtendedEraseRequest(), codec.ExtendedErasePages(pages=[1]))
    assert not [each for each in monitor.heard if isinstance(each, Damaged)]
    heard = [each.request for each in monitor.heard if isinstance(each, Asked)]
    answers = [each.response for each in monitor.heard if isinstance(each, Replied)]
    assert len(heard) + len(answers) == len(monitor.heard)
    assert [type(each).__name__ for each in answers[:3]] == ["Ack", "GetKnown", "Ack"]
