"""Program load of the virtual node (section 7.6)."""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from qlinkgen.codecs import qlink
from qlinkgen.protocols.hex_image import BrokenRecord, HexImage, HexReader, segments_of
from qlinkgen.protocols.qlink.loading import pieces
from qlinkgen.protocols.qlink.virtual_node import VirtualNode

END = b":00000001FF\r\n"


def record(kind: int, offset: int, data: bytes = b"") -> bytes:
    body = bytes((len(data), *offset.to_bytes(2, "big"), kind)) + data
    return b":" + (body + bytes((-sum(body) & 0xFF,))).hex().upper().encode() + b"\r\n"


PROGRAM = record(4, 0, b"\x00\x01") + record(0, 0x100, b"abcdefgh") + record(5, 0, b"\0\1\1\4") + END
IMAGE = HexImage(PROGRAM, ((0x10100, b"abcdefgh"),), 0x10104)


def send(node: VirtualNode, counter: int, data: bytes = b"") -> int | None:
    """Return the acknowledged counter, None without an acknowledgement."""
    request = qlink.NodeProgramLoadRequest(node=1, counter=counter, program_data=data)
    response = node.handle(qlink.decode_request(request.to_frame()), 0.0)
    if response is None:
        return None
    answer = qlink.decode_response(response.to_frame())
    assert isinstance(answer, qlink.NodeProgramLoadResponse)
    return answer.counter


def load(node: VirtualNode, text: bytes, size: int = 25) -> int:
    """Load a text as a master does; return how many pieces were acknowledged."""
    assert send(node, 0) == 0
    for number, piece in enumerate(pieces(text, size)):
        if send(node, number % 256, piece) != number % 256:
            return number
    return -1


def test_a_program_arrives() -> None:
    node = VirtualNode()
    assert load(node, PROGRAM) == -1
    assert node.program == IMAGE
    assert (node.store.fault, node.store.loading) == ("", False)
    counts = node.statistics
    assert (counts.program_loads, counts.program_pieces, counts.repeated_pieces, counts.refused_pieces) == (
        1,
        -(-len(PROGRAM) // 25),
        0,
        0,
    )


def test_a_new_node_has_no_program() -> None:
    store = VirtualNode().store
    assert (store.loading, store.image, store.fault, bytes(store.text)) == (False, None, "", b"")


def test_the_image_answers_for_itself() -> None:
    image = HexImage(b"", ((0x10, b"ab"), (0x20, b"c")))
    assert (image.size, image.start, image.end) == (3, 0x10, 0x21)
    assert image.memory() == {0x10: 97, 0x11: 98, 0x20: 99}
    empty = HexImage(END, ())
    assert (empty.size, empty.start, empty.end, empty.entry, empty.memory()) == (0, 0, 0, None, {})


def test_a_request_without_any_data_opens() -> None:
    body = bytes((4, qlink.NodeProgramLoadRequest.ID, 1))
    frame = b"\xa5\xa5" + body + crc_hqx(body, 0xFFFF).to_bytes(2, "big")
    node = VirtualNode()
    answer = node.handle(qlink.decode_request(frame), 0.0)
    assert answer == qlink.NodeProgramLoadResponse(node=1, counter=0)
    assert node.store.loading


def test_the_program_is_there_with_its_end_record() -> None:
    node = VirtualNode()
    text = PROGRAM.rstrip()
    assert load(node, text[:-1]) == -1
    assert (node.program, node.store.loading) == (None, True)
    last = -(-len(text[:-1]) // 25)
    assert send(node, last, text[-1:]) == last
    assert (node.program, node.store.loading) == (HexImage(text, IMAGE.segments, IMAGE.entry), False)
    assert send(node, last + 1, b"\r\n") == last + 1
    assert node.program is not None
    assert node.program.text == text + b"\r\n"


def test_a_repeated_counter_is_acknowledged_and_not_stored() -> None:
    node = VirtualNode()
    assert send(node, 0) == 0
    assert send(node, 0) == 0, "an opening may be repeated"
    for number, piece in enumerate(pieces(PROGRAM)):
        for _ in range(3):
            assert send(node, number, piece) == number
    assert node.program == IMAGE
    assert node.statistics.repeated_pieces == 2 * -(-len(PROGRAM) // 25)


def test_counters_wrap_in_a_long_program() -> None:
    node = VirtualNode()
    text = b"".join(record(0, 16 * n, bytes(range(16))) for n in range(200)) + END
    assert len(text) > 300 * 25
    send(node, 0)
    for number, piece in enumerate(pieces(text)):
        assert [send(node, number % 256, piece) for _ in range(2)] == [number % 256] * 2
    assert node.program == HexImage(text, ((0, bytes(range(16)) * 200),))


@pytest.mark.parametrize("counter", [2, 3, 255, 128])
def test_a_counter_that_is_not_the_next_is_not_acknowledged(counter: int) -> None:
    node = VirtualNode()
    send(node, 0)
    assert send(node, 0, PROGRAM[:10]) == 0
    assert send(node, counter, PROGRAM[10:20]) is None
    assert node.store.text == PROGRAM[:10]
    assert send(node, 1, PROGRAM[10:20]) == 1, "and does no harm"
    assert node.statistics.refused_pieces == 1


def test_the_counter_before_the_first_is_no_repeat() -> None:
    node = VirtualNode()
    send(node, 0)
    assert send(node, 255, b":") is None


@pytest.mark.parametrize("counter", [0, 1])
@pytest.mark.parametrize("check", [True, False])
def test_a_piece_without_an_opening_is_not_acknowledged(counter: int, check: bool) -> None:
    node = VirtualNode(check_program=check)
    assert send(node, counter, b":00") is None
    assert send(node, 5) is None
    assert (node.statistics.refused_pieces, bytes(node.store.text)) == (2, b"")


def test_an_empty_piece_counts_on() -> None:
    node = VirtualNode()
    send(node, 0)
    assert send(node, 0, PROGRAM[:20]) == 0
    assert send(node, 1) == 1
    assert send(node, 2, PROGRAM[20:30]) == 2
    assert node.store.text == PROGRAM[:30]


def test_an_opening_begins_again() -> None:
    node = VirtualNode()
    send(node, 0)
    for number, piece in enumerate(list(pieces(PROGRAM))[:2]):
        send(node, number, piece)
    assert load(node, PROGRAM) == -1
    images = [node.program]
    send(node, 0)
    images.append(node.program)
    assert images == [IMAGE, None]
    assert not node.store.text
    assert node.statistics.program_loads == 3


def test_a_reset_keeps_the_program() -> None:
    node = VirtualNode()
    load(node, PROGRAM)
    node.handle(qlink.NodeResetRequest(node=1), 0.0)
    assert node.program == IMAGE


BROKEN = [
    (record(0x41, 0, b"A"), "record 1: type 41; types are 00 to 05"),
    (record(0, 0, b"a")[:-3] + b"0", "record 1: checksum 90, must be 9E"),
    (b":0G0000", "record 1: b'0G' has a character that is not a hexadecimal digit"),
    (b":01000000 1000", "record 1: b'01000000 100' has a character"),
    (b":0100000\r\n610", "record 1: b'0100000\\r\\n610' has a character"),
    (b"S1130000", "record 1: b'S1130000' seen; a record begins with ':'"),
    (record(0, 0, b"a") + b"?", "record 2: b'?' seen; a record begins with ':'"),
    (END + b":", "record 2: b':' seen; nothing follows the end record"),
    (record(1, 0, b"a"), "record 1: 1 data bytes; type 01 has 0"),
    (record(2, 0, b"a"), "record 1: 1 data bytes; type 02 has 2"),
    (record(4, 0, b"abc"), "record 1: 3 data bytes; type 04 has 2"),
    (record(3, 0, b"abc"), "record 1: 3 data bytes; type 03 has 4"),
    (record(5, 0, b""), "record 1: 0 data bytes; type 05 has 4"),
    (record(0, 0xFFFF, b"ab"), "record 1: 2 bytes at 0xffff exceed the end of their segment"),
    (record(2, 0, b"\x10\0") + record(0, 0xFFFF, b"ab"), "record 2: 2 bytes at 0x1ffff exceed the end"),
    (record(4, 0, b"\xff\xff") + record(0, 0xFFFF, b"ab"), "record 2: 2 bytes at 0xffffffff exceed the end"),
    (
        record(0, 0, b"abc") + record(0, 9, b"x") + record(0, 2, b"c") + END,
        "record 4: overlapping data at 0x2",
    ),
]


@pytest.mark.parametrize(("text", "fault"), BROKEN)
def test_a_broken_program_is_not_acknowledged(text: bytes, fault: str) -> None:
    node = VirtualNode()
    assert load(node, text) == (len(text) - 1) // 25, "the piece that shows it is refused"
    assert fault in node.store.fault
    assert (node.program, node.store.loading) == (None, False)
    pieces_before = node.statistics.program_pieces
    assert send(node, pieces_before % 256, b":") is None, "and so is anything after it"
    assert (node.statistics.program_pieces, node.statistics.refused_pieces) == (pieces_before, 2)
    assert load(node, PROGRAM) == -1, "until the next opening"
    assert (node.program, node.store.fault) == (IMAGE, "")


def test_text_behind_the_end_record_takes_the_program_back() -> None:
    node, images = VirtualNode(), []
    for number, piece in enumerate([END, b" \r\n", b"more"]):
        if number == 0:
            send(node, 0)
        send(node, number, piece)
        images.append(node.program)
    assert images == [HexImage(END, ()), HexImage(END + b" \r\n", ()), None]
    assert node.store.fault == "record 2: b'more' seen; nothing follows the end record"


def test_what_came_before_a_broken_piece_may_be_repeated() -> None:
    node = VirtualNode()
    send(node, 0)
    assert [send(node, 0, b":"), send(node, 1, b"?" * 10), send(node, 0, b":")] == [0, None, 0]


def test_a_node_that_does_not_check_takes_anything() -> None:
    node = VirtualNode(check_program=False)
    text = b"nonsense, and quite a lot of it\n" + PROGRAM
    assert load(node, text) == -1
    assert (node.program, bytes(node.store.text)) == (None, text)
    assert "record 1: b'nonsense'" in node.store.fault
    load(node, PROGRAM)
    assert node.program == IMAGE


@pytest.mark.parametrize("text", [PROGRAM, PROGRAM.replace(b"\r\n", b"\n"), PROGRAM.replace(b"\r\n", b"\r")])
@pytest.mark.parametrize("change", [bytes.lower, bytes.upper, bytes.rstrip, lambda t: b"\n \t" + t + b"\n\n"])
def test_line_ends_and_case_make_no_difference(text: bytes, change: Callable[[bytes], bytes]) -> None:
    node = VirtualNode()
    assert load(node, change(text)) == -1
    assert node.program is not None
    assert (node.program.segments, node.program.entry) == (IMAGE.segments, IMAGE.entry)


def test_segments_are_sorted_and_joined() -> None:
    assert segments_of([(9, b"z"), (2, b""), (4, b"cd"), (2, b"ab"), (8, b"y")]) == ((2, b"abcd"), (8, b"yz"))


def test_addresses_of_both_kinds() -> None:
    reader = HexReader()
    reader.feed(record(4, 0, b"\0\2") + record(0, 1, b"a") + record(2, 0, b"\x10\0") + record(0, 1, b"b"))
    reader.feed(record(4, 0, b"\0\1") + record(0, 0xFFFF, b"cd"))
    with pytest.raises(BrokenRecord, match="overlapping data"):
        reader.feed(
            record(2, 0, b"\0\0") + record(0, 2, b"e") + record(2, 0, b"\x10\0") + record(0, 1, b"x") + END
        )
    reader = HexReader()
    reader.feed(record(4, 0, b"\0\2") + record(0, 1, b"a") + record(2, 0, b"\x10\0") + record(0, 1, b"b"))
    reader.feed(record(4, 0, b"\0\1") + record(0, 0xFFFF, b"cd") + record(3, 0, b"\x12\x34\x56\x78") + END)
    assert reader.segments == ((0x10001, b"b"), (0x1FFFF, b"cda"))
    assert (reader.entry, reader.records) == (0x12345678, 8)


chunks = st.lists(st.tuples(st.integers(0, 0xFFFF_FF00), st.binary(min_size=1, max_size=40)), max_size=8)


@given(chunks, st.integers(1, 25), st.data())
def test_any_program_is_rebuilt(found: list[tuple[int, bytes]], size: int, data: st.DataObject) -> None:
    memory = {start + index: byte for start, part in found for index, byte in enumerate(part)}
    text = b"".join(
        record(4, 0, (address >> 16).to_bytes(2, "big")) + record(0, address & 0xFFFF, bytes((byte,)))
        for address, byte in memory.items()
    )
    node = VirtualNode()
    send(node, 0)
    for number, piece in enumerate(pieces(text + END, size)):
        for _ in range(data.draw(st.integers(1, 2), label="times sent") if number < 20 else 1):
            assert send(node, number % 256, piece) == number % 256
    assert node.program is not None
    assert node.program.memory() == memory
    assert node.program.text == text + END


@given(st.binary(max_size=200), st.integers(1, 25))
def test_no_text_makes_it_raise(text: bytes, size: int) -> None:
    node = VirtualNode()
    load(node, b":" + text, size)
    assert node.program is None or not node.store.fault


@given(st.data())
def test_the_pieces_do_not_matter(data: st.DataObject) -> None:
    text = PROGRAM[: data.draw(st.integers(0, len(PROGRAM)))] + data.draw(st.sampled_from([b"", b"x", b"\n"]))
    outcomes = []
    for size in (1, data.draw(st.integers(2, 300))):
        reader, broken = HexReader(), False
        try:
            for at in range(0, len(text), size):
                reader.feed(text[at : at + size])
        except BrokenRecord:
            broken = True
        outcomes.append((broken, None if broken else reader.segments, reader.entry, reader.records))
    assert outcomes[0] == outcomes[1]
