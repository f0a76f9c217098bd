"""The libraries of some protocols: the same messages by them and by the schemas of the library."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Sequence
from types import ModuleType, SimpleNamespace
from typing import Any

from benchmarks import messages
from benchmarks.library_pairs import (
    REPEATS,
    Pair,
    Side,
    Values,
    arguments,
    decoder,
    encoder,
    module_of,
    own,
    reader,
    spelled,
)
from benchmarks.peer import load

_MAVLINK: Sequence[tuple[str, Values]] = (
    (
        "heartbeat",
        {"custom_mode": 4, "type": 2, "autopilot": 3, "base_mode": 81, "system_status": 4},
    ),
    (
        "attitude",
        {
            "time_boot_ms": 123456,
            "roll": 0.0625,
            "pitch": -0.25,
            "yaw": 1.5,
            "rollspeed": 0.5,
            "pitchspeed": -0.125,
            "yawspeed": 0.75,
        },
    ),
    (
        "vfr_hud",
        {
            "airspeed": 12.5,
            "groundspeed": 13.25,
            "heading": 270,
            "throttle": 40,
            "alt": 102.5,
            "climb": -0.5,
        },
    ),
    (
        "command_long",
        {
            "param1": 1.0,
            "param2": 2.0,
            "param3": 0.0,
            "param4": 0.0,
            "param5": 0.5,
            "param6": 0.25,
            "param7": 10.0,
            "command": 400,
            "target_system": 1,
            "target_component": 1,
            "confirmation": 0,
        },
    ),
    (
        "rc_channels",
        {"time_boot_ms": 123500, "chancount": 18, "rssi": 200}
        | {f"chan{number}_raw": 1000 + 50 * number for number in range(1, 19)},
    ),
)


#: What pymavlink leaves to the program.
_VERSION: Values = {"mavlink_version": 3}


def mavlink() -> Pair:
    """MAVLink 2 beside pymavlink without the C of fastcrc."""
    load("pymavlink")
    dialect: Any = _without("fastcrc", "pymavlink.dialects.v20.common")
    link = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    kinds = [getattr(dialect, f"MAVLink_{name}_message") for name, _ in _MAVLINK]
    given = [
        arguments({**_VERSION, **values} if name == "heartbeat" else values) for name, values in _MAVLINK
    ]
    calls = [
        f"dialect.{kind.__name__}({each}).pack(link)" for kind, each in zip(kinds, given, strict=True)
    ] * REPEATS
    readers = {kind.id: reader(*kind.fieldnames) for kind in kinds}
    module = module_of("mavlink_2")
    ours = own(module, [(name, {"system": 1, "sequence": 0, **values}) for name, values in _MAVLINK])
    pieces = messages.chunks(b"".join(ours.encode()))

    def decode() -> list[object]:
        parse = dialect.MAVLink(None).parse_buffer
        return [readers[each.id](each) for piece in pieces for each in parse(piece) or ()]

    theirs = Side(spelled(calls, {"dialect": dialect, "link": link}), decode)
    return Pair("MAVLink 2", "pymavlink", len(calls), 5, ours, theirs)


def _without(blocked: str, name: str) -> ModuleType:
    """A module imported as if another one were not installed; the modules imported before come back."""
    family = name.partition(".")[0]
    hidden = {each: sys.modules.pop(each) for each in list(sys.modules) if each.partition(".")[0] == family}
    before = sys.modules.get(blocked)
    sys.modules[blocked] = None  # type: ignore[assignment]
    try:
        return load(name)
    finally:
        for each in [each for each in sys.modules if each.partition(".")[0] in {family, blocked}]:
            del sys.modules[each]
        sys.modules |= hidden | ({blocked: before} if before else {})


_PVT = (
    ("itow", "iTOW", 118_000), ("year", "year", 2024), ("month", "month", 5), ("day", "day", 17),
    ("hour", "hour", 8), ("minute", "min", 46), ("second", "second", 40), ("valid", "valid", 7),
    ("time_accuracy", "tAcc", 25), ("nano", "nano", -1234), ("fix", "fixType", 3), ("flags", "flags", 1),
    ("flags2", "flags2", 10), ("satellites", "numSV", 14), ("longitude", "lon", 8.5),
    ("latitude", "lat", 47.25), ("height", "height", 450_000), ("altitude", "hMSL", 402_000),
    ("horizontal_accuracy", "hAcc", 900), ("vertical_accuracy", "vAcc", 1500),
    ("north", "velN", 12), ("east", "velE", -30), ("down", "velD", 4),
    ("ground_speed", "gSpeed", 33), ("motion_heading", "headMot", 3.5), ("speed_accuracy", "sAcc", 60),
    ("heading_accuracy", "headAcc", 3.5), ("dilution", "pDOP", 1.25), ("flags3", "flags3", 0),
    ("vehicle_heading", "headVeh", 0.0), ("declination", "magDec", 2.5),
    ("declination_accuracy", "magAcc", 0.5),
)  # fmt: skip
_STATUS = (
    ("itow", "iTOW", 118_000), ("fix", "gpsFix", 3), ("flags", "flags", 13), ("differential", "fixStat", 0),
    ("flags2", "flags2", 8), ("ttff", "ttff", 31_000), ("uptime", "msss", 950_000),
)  # fmt: skip
_ACK = (("class", "clsID", 6), ("number", "msgID", 8))
_UBX = (
    ("nav_pvt", "NAV-PVT", _PVT),
    ("poll_status.response", "NAV-STATUS", _STATUS),
    ("ack", "ACK-ACK", _ACK),
)
#: Fields of bits, which pyubx2 takes as so many bytes.
_BITS = {"valid": 1, "flags": 1, "flags2": 1, "fixStat": 1, "flags3": 2}


def ubx() -> Pair:
    """UBX beside pyubx2, fields of bits as bytes, which is its quicker way."""
    library: Any = load("pyubx2")
    module = module_of("ubx")
    ours = own(
        module,
        [(name, {_attribute(field): value for field, _, value in fields}) for name, _, fields in _UBX],
        "response",
    )
    calls = [
        f"make({identity[:3]!r}, {identity!r}, get, parsebitfield=0, "
        f"{arguments({theirs: _bits(theirs, value) for _, theirs, value in fields})}).serialize()"
        for _, identity, fields in _UBX
    ] * REPEATS
    readers = {identity: reader(*(theirs for _, theirs, _ in fields)) for _, identity, fields in _UBX}
    stream = b"".join(ours.encode())
    encode = spelled(calls, {"make": library.UBXMessage, "get": library.GET})

    def decode() -> list[object]:
        found = library.UBXReader(io.BytesIO(stream), parsebitfield=0)
        return [readers[each.identity](each) for _, each in found]

    return Pair("UBX", "pyubx2", len(calls), 5, ours, Side(encode, decode))


def _attribute(field: str) -> str:
    return "class_" if field == "class" else field


def _bits(name: str, value: Any) -> Any:
    return value.to_bytes(_BITS[name], "little") if name in _BITS else value


_CHANNELS = [172 + 100 * number for number in range(16)]
_CRSF = (
    (
        "RC_CHANNELS_PACKED", "rc_channels",
        (("channels", "channels", _CHANNELS),),
    ),
    (
        "LINK_STATISTICS", "link_statistics",
        (
            ("up_rssi_1", "uplink_rssi_ant_1", 60), ("up_rssi_2", "uplink_rssi_ant_2", 62),
            ("up_quality", "uplink_link_quality", 99), ("up_snr", "uplink_snr", -4),
            ("antenna", "diversity_active_antenna", 1), ("mode", "rf_mode", 2),
            ("up_power", "uplink_tx_power", 3), ("down_rssi", "downlink_rssi", 70),
            ("down_quality", "downlink_link_quality", 98), ("down_snr", "downlink_snr", 8),
        ),
    ),
    (
        "BATTERY_SENSOR", "battery",
        (
            ("voltage", "voltage", 16.5), ("current", "current", 12.5), ("used", "capacity", 850),
            ("remaining", "remaining", 60),
        ),
    ),
)  # fmt: skip


def crsf() -> Pair:
    """CRSF beside crsf-parser, which counts voltage and current in tenths, and channels from the last."""
    library, handling, payloads = (load(f"crsf_parser{each}") for each in ("", ".handling", ".payloads"))
    ours = own(
        module_of("crsf"),
        [(name, {own: value for own, _, value in fields}) for _, name, fields in _CRSF],
    )
    pieces = messages.chunks(b"".join(ours.encode()))
    kinds = [getattr(payloads.PacketsTypes, number) for number, _, _ in _CRSF]
    calls = [
        f"build(kinds.{kind}, { ({theirs: _plain(value) for _, theirs, value in fields})!r})"
        for kind, _, fields in _CRSF
    ] * REPEATS
    encode = spelled(calls, {"build": handling.crsf_build_frame, "kinds": payloads.PacketsTypes})
    readers = {
        kind: reader(*(theirs for _, theirs, _ in fields))
        for kind, (_, _, fields) in zip(kinds, _CRSF, strict=True)
    }

    def decode() -> list[object]:
        found: list[object] = []
        parser: Any = library.CRSFParser(
            lambda frame, _: found.append(readers[frame.header.type](frame.payload))
        )
        buffer = bytearray()
        for piece in pieces:
            buffer += piece
            parser.parse_stream(buffer)
        return found

    return Pair("CRSF", "crsf-parser", len(calls), 5, ours, Side(encode, decode))


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return round(value * 10)
    return value[::-1] if isinstance(value, list) else value


_REGISTERS = [100 * number for number in range(10)]


def modbus() -> Pair:
    """Modbus RTU beside pymodbus: a master's requests encoded, their responses decoded.

    pymodbus takes all that it has as one frame, so both get a frame at a time.
    """
    framer, pdu = load("pymodbus.framer"), load("pymodbus.pdu")
    registers, bits = load("pymodbus.pdu.register_message"), load("pymodbus.pdu.bit_message")
    module = module_of("modbus_rtu")
    requests: list[tuple[str, Values]] = [
        ("read_holding_registers.request", {"start": 100, "quantity": 10}),
        ("write_multiple_registers.request", {"start": 100, "registers": _REGISTERS}),
        ("write_single_register.request", {"number": 100, "value": 7}),
        ("read_coils.request", {"start": 5, "quantity": 16}),
    ]
    responses: list[tuple[str, Values]] = [
        ("read_holding_registers.response", {"registers": _REGISTERS}),
        ("write_multiple_registers.response", {"start": 100, "quantity": 10}),
        ("write_single_register.response", {"number": 100, "value": 7}),
        ("read_coils.response", {"coils": [True, False] * 8}),
    ]
    sent, received = (
        [(module.MESSAGES[name], {"node": 17, **values}) for name, values in listed] * REPEATS
        for listed in (requests, responses)
    )
    frames = encoder(received)()
    ours = Side(encoder(sent), decoder(module, frames, "response"))
    calls = [
        f"build({call})"
        for call in (
            "registers.ReadHoldingRegistersRequest(dev_id=17, address=100, count=10)",
            f"registers.WriteMultipleRegistersRequest(dev_id=17, address=100, registers={_REGISTERS})",
            "registers.WriteSingleRegisterRequest(dev_id=17, address=100, registers=[7])",
            "bits.ReadCoilsRequest(dev_id=17, address=5, count=16)",
        )
    ] * REPEATS
    readers = {
        registers.ReadHoldingRegistersResponse: reader("registers"),
        registers.WriteMultipleRegistersResponse: reader("address", "count"),
        registers.WriteSingleRegisterResponse: reader("address", "registers"),
        bits.ReadCoilsResponse: reader("bits"),
    }
    client = framer.FramerRTU(pdu.DecodePDU(is_server=False))
    encode = spelled(calls, {"build": client.buildFrame, "registers": registers, "bits": bits})

    def decode() -> list[object]:
        found = (client.handleFrame(frame, 0, 0)[1] for frame in frames)
        return [readers[type(each)](each) for each in found if each is not None]

    return Pair("Modbus RTU", "pymodbus", len(calls), 2, ours, Side(encode, decode))


def dynamixel() -> Pair:
    """Dynamixel 2 beside dynamixel-sdk: writes encoded, status packets decoded.

    dynamixel-sdk reads as many bytes as a packet has, so a packet at a time is decoded.
    """
    library = load("dynamixel_sdk")
    module = module_of("dynamixel_2")
    position = bytes((0, 8, 0, 0))
    sent: list[tuple[Any, Values]] = [
        (module.WriteRequest, {"node": 1, "start": 116, "data": position}),
        (module.WriteRequest, {"node": 2, "start": 64, "data": b"\1"}),
        (module.WriteRequest, {"node": 3, "start": 104, "data": bytes(8)}),
        (module.WriteRequest, {"node": 4, "start": 116, "data": position}),
    ] * REPEATS
    received = [
        (module.Unasked, {"node": node, "error": 0, "alert": False, "data": bytes(range(node, node + size))})
        for node, size in enumerate((4, 0, 10, 2), 1)
    ] * REPEATS
    frames = encoder(received)()
    stream = b"".join(frames)
    ours = Side(encoder(sent), decoder(module, frames, "response", ("node", "error", "alert")))
    handler: Any = library.Protocol2PacketHandler()
    written: list[bytes] = []
    line = SimpleNamespace(is_using=False, clearPort=lambda: None, isPacketTimeout=lambda: True)

    def write(packet: list[int]) -> int:
        written.append(bytes(packet))
        return len(packet)

    line.writePort = write

    def encode() -> list[bytes]:
        written.clear()
        for _, values in sent:
            data = list(values["data"])
            handler.writeTxOnly(line, values["node"], values["start"], len(data), data)
        return list(written)

    def decode() -> list[object]:
        line.readPort = io.BytesIO(stream).read
        found: list[object] = []
        while True:
            packet, result = handler.rxPacket(line, False)
            if result != library.COMM_SUCCESS:
                return found
            found.append((packet[4], packet[8] & 0x7F, packet[8] >> 7, bytes(packet[9:-2])))

    return Pair("Dynamixel 2", "dynamixel-sdk", len(sent), 2, ours, Side(encode, decode))


PAIRS: tuple[Callable[[], Pair], ...] = (mavlink, ubx, crsf, modbus, dynamixel)
