"""Modbus RTU by pymodbus."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from pymodbus.framer import FramerBase, FramerRTU
from pymodbus.pdu import DecodePDU, ModbusPDU
from pymodbus.pdu import bit_message as bits
from pymodbus.pdu import file_message as files
from pymodbus.pdu import mei_message as mei
from pymodbus.pdu import other_message as other
from pymodbus.pdu import register_message as registers
from pymodbus.pdu.diag_message import DiagnosticBase
from pymodbus.pdu.exceptionresponse import ExceptionResponse

from qlinkgen.model.message import Direction
from tests.library.protocols import Record, pairs

#: Message to the class of pymodbus, and each field to its argument and attribute.
_KINDS: Mapping[str, tuple[type[ModbusPDU], Mapping[str, str]]] = {
    f"{name}.{direction}": (kind, pairs(named))
    for name, kinds, requested, answered in (
        (
            "read_coils",
            (bits.ReadCoilsRequest, bits.ReadCoilsResponse),
            "start=address quantity=count",
            "coils=bits",
        ),
        (
            "read_discrete_inputs",
            (bits.ReadDiscreteInputsRequest, bits.ReadDiscreteInputsResponse),
            "start=address quantity=count",
            "inputs=bits",
        ),
        (
            "read_holding_registers",
            (registers.ReadHoldingRegistersRequest, registers.ReadHoldingRegistersResponse),
            "start=address quantity=count",
            "registers=registers",
        ),
        (
            "read_input_registers",
            (registers.ReadInputRegistersRequest, registers.ReadInputRegistersResponse),
            "start=address quantity=count",
            "registers=registers",
        ),
        (
            "write_single_coil",
            (bits.WriteSingleCoilRequest, bits.WriteSingleCoilResponse),
            "number=address value=bits",
            "number=address value=bits",
        ),
        (
            "write_single_register",
            (registers.WriteSingleRegisterRequest, registers.WriteSingleRegisterResponse),
            "number=address value=registers",
            "number=address value=registers",
        ),
        (
            "read_exception_status",
            (other.ReadExceptionStatusRequest, other.ReadExceptionStatusResponse),
            "",
            "outputs=status",
        ),
        (
            "get_comm_event_counter",
            (other.GetCommEventCounterRequest, other.GetCommEventCounterResponse),
            "",
            "status=status events=count",
        ),
        (
            "write_multiple_registers",
            (registers.WriteMultipleRegistersRequest, registers.WriteMultipleRegistersResponse),
            "start=address registers=registers",
            "start=address quantity=count",
        ),
        (
            "write_multiple_coils",
            (bits.WriteMultipleCoilsRequest, bits.WriteMultipleCoilsResponse),
            "start=address coils=bits",
            "start=address quantity=count",
        ),
        ("report_server_id", (other.ReportDeviceIdRequest, other.ReportDeviceIdResponse), "", ""),
        (
            "mask_write_register",
            (registers.MaskWriteRegisterRequest, registers.MaskWriteRegisterResponse),
            "number=address and_mask=and_mask or_mask=or_mask",
            "number=address and_mask=and_mask or_mask=or_mask",
        ),
        (
            "read_write_multiple_registers",
            (registers.ReadWriteMultipleRegistersRequest, registers.ReadWriteMultipleRegistersResponse),
            """read_start=read_address read_quantity=read_count write_start=write_address
            registers=write_registers""",
            "registers=registers",
        ),
        (
            "read_fifo_queue",
            (files.ReadFifoQueueRequest, files.ReadFifoQueueResponse),
            "pointer=address",
            "registers=values",
        ),
    )
    for direction, kind, named in zip(("request", "response"), kinds, (requested, answered), strict=True)
}
_NAMES = {kind: name for name, (kind, _) in _KINDS.items()}
#: What pymodbus calls a value, and back; it has two states each of a coil, and of a server.
_COIL = {"off": [False], "on": [True]}
_LEVELS = {"basic": 1, "regular": 2, "extended": 3, "one": 4}
_MORE = {"none": 0, "follow": 0xFF}
_FILES: Mapping[str, Callable[..., ModbusPDU]] = {
    "read_file_record.request": files.ReadFileRecordRequest,
    "read_file_record.response": files.ReadFileRecordResponse,
    "write_file_record.request": files.WriteFileRecordRequest,
    "write_file_record.response": files.WriteFileRecordResponse,
}
_FUNCTIONS = {
    "diagnostics": 8,
    "read_file_record": 0x14,
    "write_file_record": 0x15,
    "read_device_identification": 0x2B,
} | {name.partition(".")[0]: kind.function_code for name, (kind, _) in _KINDS.items()}
_CODES = (
    None, "illegal_function", "illegal_data_address", "illegal_data_value", "server_device_failure",
    "acknowledge", "server_device_busy", None, "memory_parity_error", None, "gateway_path_unavailable",
    "gateway_target_failed",
)  # fmt: skip
_STATUS = {0: 1, 0xFFFF: 0}
_GIVEN: Mapping[str, Callable[[Any], Any]] = {
    "write_single_coil.request": _COIL.get,
    "write_single_coil.response": _COIL.get,
    "write_single_register.request": lambda value: [value],
    "write_single_register.response": lambda value: [value],
}
#: Messages that it neither builds nor reads.
UNKNOWN: frozenset[str] = frozenset()


def pdu_of(record: Record) -> ModbusPDU | None:
    """The object of pymodbus."""
    name, fields = record["message"], record["fields"]
    pdu: ModbusPDU
    if name.endswith(".exception"):
        function, code = _FUNCTIONS[name.partition(".")[0]], fields["code"]
        pdu = ExceptionResponse(function, _CODES.index(code) if code in _CODES else code)
    elif name.startswith("diagnostics"):
        pdu = DiagnosticBase(message=fields["data"])
        pdu.sub_function_code = fields["function"]
    elif name in _FILES:
        pdu = _FILES[name](records=list(map(_file_record, fields["parts"])))
    elif name.startswith("read_device_identification"):
        if fields["level"] == 0 or not _distinct(fields):
            return None
        pdu = _identification(name, fields)
    elif name == "report_server_id.response":
        *identifier, state = bytes.fromhex(fields["data"])
        if state not in {0, 0xFF}:
            return None
        pdu = other.ReportDeviceIdResponse(bytes(identifier), status=bool(state))
    else:
        kind, named = _KINDS[name]
        given = {named[each]: _given(name, each, value) for each, value in fields.items()}
        if None in given.values():
            return None
        pdu = kind(**given)
    pdu.dev_id = record["node"]
    return pdu


def _file_record(part: Mapping[str, Any]) -> files.FileRecord:
    data = b"".join(each.to_bytes(2, "big") for each in part.get("registers", ()))
    size = 0 if data else 2 * part["count"]
    return files.FileRecord(part.get("file", 0), part.get("record", 0), data, size)


def _distinct(fields: Mapping[str, Any]) -> bool:
    """Whether no number of an object occurs twice; pymodbus has one text for each."""
    numbers = [each["number"] for each in fields.get("objects", ())]
    return len({*numbers}) == len(numbers)


def _identification(name: str, fields: Mapping[str, Any]) -> ModbusPDU:
    level = _LEVELS.get(fields["level"], fields["level"])
    if name.endswith(".request"):
        return mei.ReadDeviceInformationRequest(read_code=level, object_id=fields["first"])
    texts = {each["number"]: each["value"].encode() for each in fields["objects"]}
    pdu = mei.ReadDeviceInformationResponse(read_code=level, information=texts)
    pdu.conformity, pdu.next_object_id = fields["conformity"], fields["next"]
    pdu.more_follows = _MORE.get(fields["more"], fields["more"])
    return pdu


def _given(name: str, field: str, value: Any) -> Any:
    if field == "status":
        return _STATUS.get(value)
    return _GIVEN[name](value) if field == "value" else value


def record_of(pdu: ModbusPDU | None) -> Record | None:
    """What an object of pymodbus says."""
    if isinstance(pdu, ExceptionResponse):
        command = next(each for each, number in _FUNCTIONS.items() if number | 0x80 == pdu.function_code)
        code = dict(enumerate(_CODES)).get(pdu.exception_code) or pdu.exception_code
        return {"message": f"{command}.exception", "node": pdu.dev_id, "fields": {"code": code}}
    if pdu is None or (name := _NAMES.get(type(pdu))) is None:
        return None
    fields = {each: getattr(pdu, attribute) for each, attribute in _KINDS[name][1].items()}
    if "value" in fields:
        (value,) = fields["value"]
        fields["value"] = value
        if isinstance(value, bool):
            del fields["value"]  # any number but 0xFF00 is off
    fields.pop("status", None)  # likewise
    return {"message": name, "node": pdu.dev_id, "fields": fields}


def framer(kind: type[FramerBase], direction: Direction) -> FramerBase:
    """What reads and builds frames of a direction."""
    return kind(DecodePDU(is_server=direction == "request"))


def is_read(function: int, direction: Direction) -> bool:
    """Whether pymodbus reads such a frame; it refuses requests for odd numbers of registers of files."""
    return (function, direction) != (0x14, "request")


def build(record: Record) -> bytes | None:
    pdu = pdu_of(record)
    return None if pdu is None else framer(FramerRTU, "request").buildFrame(pdu)


def read(wire: bytes, direction: Direction) -> Record | None:
    if not is_read(wire[1], direction):
        return None
    return record_of(framer(FramerRTU, direction).handleFrame(wire, 0, 0)[1])
