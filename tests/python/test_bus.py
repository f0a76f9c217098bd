"""Bus modules: every command can be called and handled, and type checkers know the results."""

from __future__ import annotations

import asyncio
import inspect
import json
import os
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest import mock

import pytest

from qlinkgen.backends.base import OWN, Options
from qlinkgen.backends.python import bus, load
from qlinkgen.backends.python import generate as generate_codec
from qlinkgen.model.protocol import Protocol
from qlinkgen.model.transaction import Command
from qlinkgen.plan import plan_of
from qlinkgen.schema import loads
from tests.python.protocols import EVERY as EVERY_PROTOCOL
from tests.python.protocols import build, defaults, module, protocol

ROOT = Path(__file__).parents[2]
BUSES = ("qlink", "modbus_rtu", "dynamixel", "kitchen_sink")
CALLERS = ("MasterCalls", "NodeCalls", "AsyncMasterCalls", "AsyncNodeCalls")
EVERY = [(name, command) for name in BUSES for command in protocol(name).commands]


def loaded(model: Protocol, codec: ModuleType, options: Options | None = None) -> Any:
    """The bus module, compiled in memory with a codec module in memory."""
    made = ModuleType(f"wire.{model.name}_bus")
    made.__package__ = "wire"
    with mock.patch.dict(sys.modules, {"wire": ModuleType("wire"), f"wire.{model.name}": codec}):
        exec(compile(bus.render(plan_of(model, options or Options())), made.__name__, "exec"), made.__dict__)
    return made


@cache
def bus_of(name: str) -> Any:
    return loaded(protocol(name), module(name))


def recorder(base: type[Any], node: int) -> tuple[Any, list[tuple[Any, Any]]]:
    """An object of a class of calls that records its requests, and the record."""
    notes: list[tuple[Any, Any]] = []

    def note(request: Any, response: Any = None) -> Any:
        notes.append((request, response))
        return response and response.__new__(response)

    async def note_later(request: Any, response: Any = None) -> Any:
        return note(request, response)

    used = note_later if base.__name__.startswith("Async") else note
    made = type(
        "Recorder", (base,), {"ask": staticmethod(used), "tell": staticmethod(used), "number": node}
    )()
    return made, notes


def result(value: Any) -> Any:
    return asyncio.run(value) if inspect.iscoroutine(value) else value


def arguments_of(name: str, command: Command) -> tuple[int, dict[str, Any]]:
    """A node's address, and the fields of a request at their defaults."""
    fields = defaults(name, command.request)
    fields.pop(protocol(name).address_name or "", None)
    nodes = protocol(name).bus.nodes
    assert nodes
    return nodes[1], fields


@pytest.mark.parametrize("caller", CALLERS)
@pytest.mark.parametrize(("name", "command"), EVERY, ids=lambda value: getattr(value, "name", value))
def test_every_command_can_be_called(name: str, command: Command, caller: str) -> None:
    base = getattr(bus_of(name), caller)
    if "Node" in caller and command.addressing == "broadcast":
        assert not hasattr(base, command.name)
        return
    node, fields = arguments_of(name, command)
    calls, notes = recorder(base, node)
    here = [] if "Node" in caller or command.addressing == "broadcast" else [node]
    answer = result(getattr(calls, command.name)(*here, **fields))
    address = protocol(name).address_name or ""
    expected = command.request.default_address if command.addressing == "broadcast" else node
    response = module(name).MESSAGES[command.response.name] if command.response else None
    assert notes == [(build(name, command.request, **{address: expected}), response)]
    assert type(answer) is (response or type(None))


@pytest.mark.parametrize("caller", CALLERS)
@pytest.mark.parametrize("name", BUSES)
def test_a_method_has_the_arguments_of_its_request(name: str, caller: str) -> None:
    made, address = bus_of(name), protocol(name).address_name
    for command in protocol(name).commands:
        method = getattr(getattr(made, caller), command.name, None)
        if method is None:
            continue
        request = module(name).MESSAGES[command.request.name]
        taken = list(inspect.signature(method).parameters.values())[1:]
        wanted = [p for p in inspect.signature(request).parameters.values() if p.name != address]
        if "Node" not in caller and command.addressing != "broadcast":
            first = taken.pop(0)
            assert (first.name, first.default) == (address, inspect.Parameter.empty)
        assert taken == wanted, command.name
        assert inspect.iscoroutinefunction(method) == caller.startswith("Async")


def test_docstrings_have_unit_range_section_and_broadcast() -> None:
    made = bus_of("qlink")
    text = " ".join(made.MasterCalls.node_setup.__doc__.split())
    assert "section" in text
    assert "0.0..25.5 s in steps of 1/10" in text
    assert "1..16; or 0 for a single node on the line with any number" in text
    assert "node:" not in made.NodeCalls.node_setup.__doc__
    assert "1..16; or 0 for all of them." in made.MasterCalls.node_start.__doc__
    assert "repeats counter of the request" in made.SlaveHandlers.motion.__doc__
    for each in (*CALLERS, "SlaveHandlers"):
        methods = inspect.getmembers(getattr(made, each), inspect.isfunction)
        assert all(method.__doc__ for name, method in methods if name != "__init__")


def test_a_broadcast_is_not_answered() -> None:
    modbus, codec = bus_of("modbus_rtu"), module("modbus_rtu")
    for caller in ("MasterCalls", "AsyncMasterCalls"):
        calls, notes = recorder(getattr(modbus, caller), 1)
        assert result(calls.write_single_register(0, number=4, value=5)) is None
        assert notes == [(codec.WriteSingleRegisterRequest(address=0, number=4, value=5), None)]
        assert result(calls.write_single_register(7, number=4, value=5)) is not None
    assert "which do not respond: returns None" in " ".join(
        modbus.MasterCalls.write_single_register.__doc__.split()
    )


@pytest.mark.parametrize("caller", CALLERS)
def test_a_runtime_must_define_how_requests_are_sent(caller: str) -> None:
    calls = getattr(bus_of("qlink"), caller)()
    codec = module("qlink")
    with pytest.raises(NotImplementedError):
        result(calls.ask(codec.NodeInfoRequest(node=1), codec.NodeInfoResponse))
    with pytest.raises(NotImplementedError):
        result(calls.tell(codec.NodeStartRequest(node=1)))


# Host


HOST = {command.name: command for command in protocol("mc1231a").commands}
HOST_CALLERS = ("HostCalls", "AxisCalls", "AsyncHostCalls", "AsyncAxisCalls")
ON_AXIS = {name for name, command in HOST.items() if command.attributes["axis"] in ("current", "unknown")}


def host_recorder(caller: str) -> tuple[Any, list[tuple[Any, ...]]]:
    """An object of a class of calls of a host that records its requests, and the record."""
    notes: list[tuple[Any, ...]] = []

    def note(request: Any, response: Any, *axis: int) -> Any:
        notes.append((request, response, *axis))
        return response.__new__(response)

    async def note_later(*given: Any) -> Any:
        return note(*given)

    used = note_later if caller.startswith("Async") else note
    base = getattr(bus_of("mc1231a"), caller)
    return type("Recorder", (base,), {"ask": staticmethod(used), "number": 2})(), notes


@pytest.mark.parametrize("caller", HOST_CALLERS)
@pytest.mark.parametrize("name", HOST)
def test_every_command_of_a_host_can_be_called(name: str, caller: str) -> None:
    calls, notes = host_recorder(caller)
    one = "Axis" in caller
    assert hasattr(calls, name) == (not one or name in ON_AXIS)
    if not hasattr(calls, name):
        return
    fields = defaults("mc1231a", HOST[name].request)
    axis = [2] if name in ON_AXIS and not one else []
    answer = result(getattr(calls, name)(*axis, **fields))
    response = module("mc1231a").MESSAGES[f"{name}.response"]
    assert notes == [(build("mc1231a", HOST[name].request), response, *axis)]
    assert type(answer) is response
    parameters = inspect.signature(getattr(calls, name)).parameters
    assert ("axis" in parameters) == bool(axis)
    assert inspect.iscoroutinefunction(getattr(calls, name)) == caller.startswith("Async")


@pytest.mark.parametrize("caller", HOST_CALLERS)
def test_a_host_must_define_how_packets_are_sent(caller: str) -> None:
    calls = getattr(bus_of("mc1231a"), caller)()
    codec = module("mc1231a")
    axis = () if "Axis" in caller else (2,)
    with pytest.raises(NotImplementedError):
        result(calls.ask(codec.GetKpRequest(), codec.GetKpResponse, *axis))
    with pytest.raises(NotImplementedError):
        result(calls.tell(codec.GetKpRequest(), *axis))


def test_docstrings_of_a_host_match_the_schema() -> None:
    calls = bus_of("mc1231a").HostCalls
    assert "Double buffered." in calls.set_pos.__doc__
    assert "axis: Axis to act on, 1 or 2." in calls.set_pos.__doc__
    assert "Axis by mask." in calls.multi_update.__doc__
    assert "Axis current" not in calls.set_kp.__doc__
    assert "Axis unknown." in calls.lmts_on.__doc__
    assert "UNCONFIRMED" in calls.set_kvff.__doc__
    assert "0.0..65535.99998474121 counts/sample in steps of 1/65536" in " ".join(
        calls.set_vel.__doc__.split()
    )
    assert "number: Number of the axis" in bus_of("mc1231a").AxisCalls.__doc__


HOST_SCHEMA = """
qlinkgen: 1
protocol: {name: small_host, revision: "1", source: Made up for a test}
frame:
  packet:
    code: {role: message, type: u8}
    data: {role: payload, size: 0..4}
    checksum: {role: checksum, type: u16, algorithm: sum16, words: 2, rejected: 0}
bus: {kind: hostBUS}
defaults: {repeat: safe}
COMMANDS
"""


def small_host(commands: str, bus: str = "") -> tuple[Any, Any]:
    """Codec and bus module of a small protocol of a host."""
    text = HOST_SCHEMA.replace("COMMANDS", commands).replace("BUS", bus)
    model, faults = loads(text, "small_host.yaml")
    assert model, faults
    codec = load(model)
    return codec, loaded(model, codec)


def test_frames_of_a_host_of_parts() -> None:
    """Their requests have no class of their own."""
    parts = "{id: {role: message, type: u8}, n: {type: u8, counts: data}, data: {role: payload, size: 0..4}}"
    packet = HOST_SCHEMA[HOST_SCHEMA.index("  packet:") : HOST_SCHEMA.index("bus:")]
    text = HOST_SCHEMA.replace(packet, f"  parts: {parts}\n").replace("BUS", "")
    text = text.replace("COMMANDS", "commands: {go: {id: 1, request: {}, response: {}}}")
    model, faults = loads(text, "small_host.yaml")
    assert model, faults
    made = loaded(model, load(model))
    assert made.__all__ == ["AsyncHostCalls", "HostCalls", "SlaveHandlers"]


def test_a_host_of_a_device_without_axes() -> None:
    codec, made = small_host("commands: {go: {id: 1, request: {axis: u16}, response: {}}}")
    assert made.__all__ == ["AsyncHostCalls", "HostCalls", "SlaveHandlers"]
    notes = []
    calls = type("Calls", (made.HostCalls,), {"ask": lambda self, *given: notes.append(given)})()
    calls.go(axis=3)
    assert notes == [(codec.GoRequest(axis=3), codec.GoResponse)]


def test_a_field_may_be_called_axis_too_and_not_everything_is_answered() -> None:
    codec, made = small_host(
        "attributes: {axis: {values: [current, global]}}\n"
        "commands:\n"
        "  go: {id: 1, request: {axis: u16}, response: none, attributes: {axis: current}}\n"
        "  halt: {id: 2, request: {}, response: none, attributes: {axis: global}}\n"
        "  pick: {id: 3, request: {}, response: {}, attributes: {axis: global}}",
        ", select: {attribute: axis, values: [current], commands: {pick: 2}}",
    )
    notes = []
    calls = type("Calls", (made.HostCalls,), {"tell": lambda self, *given: notes.append(given)})()
    calls.go(2, axis=3)
    calls.halt()
    assert notes == [(codec.GoRequest(axis=3), 2), (codec.HaltRequest(),)]
    assert not hasattr(made.AxisCalls, "halt")


# Slave


@pytest.mark.parametrize("name", BUSES)
def test_methods_not_overridden_do_not_answer(name: str) -> None:
    slave = bus_of(name).SlaveHandlers(5)
    assert slave.number == 5
    for message in protocol(name).messages:
        assert slave.handle(build(name, message), 1.0) is None


@pytest.mark.parametrize("name", BUSES)
def test_each_request_calls_the_method_of_its_command(name: str) -> None:
    seen: list[tuple[str, Any, float]] = []

    def handler(command: str) -> Callable[..., Any]:
        def handle(self: Any, request: Any, now: float) -> str:
            seen.append((command, request, now))
            return f"answer of {command}"

        return handle

    commands = protocol(name).commands
    base = bus_of(name).SlaveHandlers
    slave = type("Slave", (base,), {command.name: handler(command.name) for command in commands})(1)
    for command in commands:
        request = build(name, command.request)
        assert slave.handle(request, 2.5) == f"answer of {command.name}"
        assert seen.pop() == (command.name, request, 2.5)


def test_one_handler_is_replaced_at_a_time() -> None:
    qlink = module("qlink")
    base = bus_of("qlink").SlaveHandlers

    class Echoing(base):  # type: ignore[misc, valid-type]
        def loop_back(self, request: Any, now: float) -> Any:
            return qlink.LoopBackResponse(node=self.number, offset=request.offset, data=request.data)

    class Counting(Echoing):
        def loop_back(self, request: Any, now: float) -> Any:
            request.offset += 1
            return super().loop_back(request, now)

    request = qlink.LoopBackRequest(node=3, offset=7, data=b"x")
    assert Echoing(3).handle(request, 0.0) == qlink.LoopBackResponse(node=3, offset=7, data=b"x")
    assert Counting(3).handle(request, 0.0) == qlink.LoopBackResponse(node=3, offset=8, data=b"x")
    assert Echoing(3).handle(qlink.NodeInfoRequest(node=3), 0.0) is None
    replaced = Echoing(3)
    replaced.node_info = lambda request, now: qlink.NodeInfoResponse(node=9)
    assert replaced.handle(qlink.NodeInfoRequest(node=3), 0.0) == qlink.NodeInfoResponse(node=9)


# Files


def test_each_side_of_a_host_has_its_own() -> None:
    model = protocol("mc1231a")
    device, host = (Options(role=role) for role in ("slave", "master"))
    assert loaded(model, load(model, device), device).__all__ == ["Slave", "SlaveHandlers"]
    made = loaded(model, load(model, host), host).__all__
    assert made == sorted([*HOST_CALLERS, "AsyncAxis", "AsyncDevice", "Axis", "Device"])


def test_without_a_command_that_selects_nothing_is_selected() -> None:
    model, chosen = protocol("mc1231a"), Options(only=("get_kp", "get_status", "set_1"))
    made = loaded(model, load(model, chosen), chosen)
    assert made.__all__ == ["AsyncHostCalls", "HostCalls", "SlaveHandlers"]


def test_a_side_and_commands_can_be_left_out() -> None:
    model = protocol("qlink")

    def public(**options: Any) -> Any:
        chosen = Options(**options)
        return loaded(model, load(model, chosen), chosen)

    askers = ["AsyncBus", "AsyncNode", "Bus", "Node"]
    assert public(role="master").__all__ == sorted([*CALLERS, *askers])
    assert public(role="slave").__all__ == ["Slave", "SlaveHandlers"]
    made = bus.generate(model, Options(role="slave"))
    assert [Path(path).name for path in made] == ["qlink_bus.py", "_qlink_bus.py", "__init__.py", "py.typed"]
    assert "class Bus" not in made["python/codecs/_qlink_bus.py"]
    small = public(only=("motion", "node_info.response"))
    assert hasattr(small.MasterCalls, "motion")
    assert not hasattr(small.MasterCalls, "node_info")
    assert bus.generate(model, Options(only=("node_info.response",))) == {}


SMALL = """
qlinkgen: 1
protocol: {name: small, revision: "1", source: Made up for a test}
frame:
  parts:
    start: {role: constant, value: 7E}
    length: {role: length, type: u8, counts: [data]}
    code: {role: message, type: u8}
    NODE
    data: {role: payload, size: 0..9}
    crc: {role: checksum, type: u8, algorithm: crc-8/smbus, over: [length, code, data]}
BUS
COMMANDS
"""


def small(commands: str, *, addressed: bool) -> tuple[Any, Any]:
    """Codec and bus module of a small protocol."""
    text = SMALL.replace("NODE", "node: {role: address, type: u8}" if addressed else "")
    text = text.replace(
        "BUS",
        "bus: {kind: master_slave, nodes: 1..3}\ndefaults: {addressing: node, repeat: safe}"
        if addressed
        else "bus: {kind: master_slave}\ndefaults: {repeat: safe}",
    )
    model, faults = loads(text.replace("COMMANDS", commands), "small.yaml")
    assert model, faults
    codec = load(model)
    return codec, loaded(model, codec)


def test_without_addresses_there_is_one_slave() -> None:
    commands = "commands: {go: {id: 1, request: {speed: u8}, response: {}}}"
    codec, made = small(commands, addressed=False)
    askers = ["AsyncDevice", "AsyncMasterCalls", "Device", "MasterCalls"]
    assert made.__all__ == [*askers, "Slave", "SlaveHandlers"]
    calls, notes = recorder(made.MasterCalls, 0)
    calls.go(speed=3)
    assert notes == [(codec.GoRequest(speed=3), codec.GoResponse)]


def test_commands_may_have_the_names_of_members_of_a_class() -> None:
    words = ("ask", "tell", "handle", "number", "bytes", "list", "str", "open", "close", "run", "node")
    rows = [
        f"  {word}: {{id: {at}, request: {{x: 'bytes[0..2]'}}, response: {{}}}}"
        for at, word in enumerate(words)
    ]
    codec, made = small("\n".join(["commands:", *rows]), addressed=True)
    calls, notes = recorder(made.NodeCalls, 2)
    for word in words:
        getattr(calls, f"{word}_")(x=b"1")
        assert notes.pop()[0] == codec.MESSAGES[f"{word}.request"](node=2, x=b"1")
    assert made.SlaveHandlers(1).handle(codec.HandleRequest(node=1, x=b""), 0.0) is None


# Type checkers and linters


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the codecs of every protocol, bus modules of every bus, and a program that uses them."""
    folder = tmp_path_factory.mktemp("generated")
    outputs: dict[str, str] = {}
    for name in EVERY_PROTOCOL:
        outputs.update(generate_codec(protocol(name), Options(package=OWN)))
    for name in (*BUSES, "mc1231a"):
        outputs.update(bus.generate(protocol(name), Options(package=OWN)))
    for path, text in outputs.items():
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, "utf-8")
    (folder / "python/program.py").write_text(PROGRAM)
    return folder / "python"


PROGRAM = """
from __future__ import annotations

from typing import TypeVar, assert_type

from wire import mc1231a as chip_codec
from wire import mc1231a_bus as mc1231a
from wire import modbus_rtu as modbus_codec
from wire import modbus_rtu_bus as modbus_rtu
from wire import qlink as codec
from wire import qlink_bus as qlink

R = TypeVar("R", bound=codec.Message)


class Bus(qlink.MasterCalls):
    def ask(self, request: codec.Message, response: type[R]) -> R:
        answer = codec.decode_response(request.to_frame())
        assert isinstance(answer, response)
        return answer

    def tell(self, request: codec.Message) -> None:
        request.to_frame()


class Node(qlink.NodeCalls):
    def __init__(self, number: int, bus: Bus) -> None:
        self.number = number
        self._bus = bus
        self._counter = 0

    def ask(self, request: codec.Message, response: type[R]) -> R:
        return self._bus.ask(request, response)

    def motion(
        self, *, counter: int | None = None, outputs: int = 0, segments: list[int] | None = None
    ) -> codec.MotionResponse:
        self._counter += 1
        used = self._counter if counter is None else counter
        return super().motion(counter=used, outputs=outputs, segments=segments)


class AsyncNode(qlink.AsyncNodeCalls):
    def __init__(self, number: int) -> None:
        self.number = number

    async def motion(
        self, *, counter: int | None = None, outputs: int = 0, segments: list[int] | None = None
    ) -> codec.MotionResponse:
        return await super().motion(counter=counter or 0, outputs=outputs, segments=segments)


class Slave(qlink.SlaveHandlers):
    def motion(self, request: codec.MotionRequest, now: float) -> codec.MotionResponse | None:
        return codec.MotionResponse(node=self.number, counter=request.counter) if now > 1 else None

    def node_start(self, request: codec.NodeStartRequest, now: float) -> None:
        self.number = request.node


def sync(bus: Bus, node: Node, modbus: modbus_rtu.MasterCalls, modbus_node: modbus_rtu.NodeCalls) -> None:
    assert_type(bus.motion(3), codec.MotionResponse)
    assert_type(node.motion(), codec.MotionResponse)
    assert_type(node.node_info().position_type, codec.PositionType | int)
    assert_type(modbus.write_single_register(1), modbus_codec.WriteSingleRegisterResponse | None)
    assert_type(modbus_node.write_single_register(), modbus_codec.WriteSingleRegisterResponse)
    bus.node_sync(counter=1)
    assert_type(Slave(3).handle(codec.MotionRequest(node=3), 2.0), codec.Message | None)


C = TypeVar("C", bound=chip_codec.Message)


class Chip(mc1231a.HostCalls):
    def ask(self, request: chip_codec.Message, response: type[C], axis: int | None = None) -> C:
        return response.from_bytes(bytes(axis or 0))

    def update(self, axis: int, *, check: bool = False) -> chip_codec.UpdateResponse:
        return super().update(axis)


def host(chip: Chip, axis: mc1231a.AxisCalls) -> None:
    assert_type(chip.get_actl_pos(2).value, int)
    assert_type(axis.get_vel(), chip_codec.GetVelResponse)
    assert_type(chip.set_vel(1, value=2.75), chip_codec.SetVelResponse)
    chip.multi_update(axes=chip_codec.Axes.AXIS_1)


async def asynchronous_host(chip: mc1231a.AsyncHostCalls, axis: mc1231a.AsyncAxisCalls) -> None:
    assert_type(await chip.get_status(1), chip_codec.GetStatusResponse)
    assert_type(await axis.get_status(), chip_codec.GetStatusResponse)


async def asynchronous(bus: qlink.AsyncMasterCalls, node: AsyncNode) -> None:
    assert_type(await bus.motion(3), codec.MotionResponse)
    assert_type(await node.motion(counter=None), codec.MotionResponse)
    await bus.node_start(0)
"""


def run(*command: str, cwd: Path) -> str:
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    return done.stdout


def test_mypy_strict_is_content(written: Path) -> None:
    config = written / "mypy.ini"
    config.write_text("[mypy]\nstrict = True\nwarn_unreachable = True\n")
    checked = ("-p", "wire", "-m", "program")
    run(sys.executable, "-m", "mypy", "--config-file", str(config), *checked, cwd=written)


def test_pyright_strict_is_content(written: Path) -> None:
    pytest.importorskip("pyright", reason="needs pyright (pip install pyright[nodejs])")
    # Buses import the package, and pyright does not follow an editable installation.
    settings = {"typeCheckingMode": "strict", "include": ["wire", "program.py"], "extraPaths": [str(ROOT)]}
    (written / "pyrightconfig.json").write_text(json.dumps(settings))
    run(sys.executable, "-m", "pyright", "--pythonversion", "3.11", cwd=written)


def test_a_module_needs_its_codecs_and_nothing_else(written: Path) -> None:
    code = "old = set(sys.modules); import wire.qlink_bus; print(*set(sys.modules) - old)"
    begin = "import sys; sys.path.insert(0, '.'); "
    new = set(run(sys.executable, "-S", "-E", "-c", begin + code, cwd=written).split())
    rest = {each for each in new if not each.startswith("wire")}
    assert rest <= {"__future__", "struct", "_struct", "binascii", "_operator"}


@pytest.mark.parametrize("name", [*BUSES, "mc1231a"])
def test_lines_are_not_too_long_and_nothing_trails(written: Path, name: str) -> None:
    text = (written / f"wire/{name}_bus.py").read_text("utf-8")
    for number, line in enumerate(text.splitlines(), 1):
        assert line == line.rstrip(), f"{name}:{number}"
        assert len(line) <= 110, f"{name}:{number}: {line}"
    assert "\n\n\n\n" not in text


def test_the_text_does_not_depend_on_the_hash_seed() -> None:
    code = (
        "from tests.python.test_bus import *; import hashlib;"
        "texts = [bus.render(plan_of(protocol(n), Options())) for n in BUSES];"
        "print(hashlib.sha256(''.join(texts).encode()).hexdigest())"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    seen = set()
    for seed in ("0", "4711"):
        command = [sys.executable, "-c", code]
        seeded = {**environment, "PYTHONHASHSEED": seed}
        seen.add(subprocess.run(command, env=seeded, cwd=ROOT, capture_output=True, check=True).stdout)
    assert len(seen) == 1


VALUED = """\
qlinkgen: 1
protocol: {name: valued, title: Valued, revision: "1", source: Manual}
frame:
  parts:
    start: FE
    length: {type: u8, counts: data}
    number: {role: counter, type: u8, per: frame}
    component: {type: u8, default: 1, range: 1..9}
    code: {role: message, type: u8}
    data: {role: payload, size: 0..32}
    crc: {type: u16, algorithm: crc-16/modbus, over: [length, number, component, code, data]}
bus: {kind: master_slave, response_within: 5 ms}
defaults: {repeat: safe}
commands:
  read: {id: 1, request: {start: u8}, response: {value: u16}}
"""


def test_calls_take_the_values_of_every_frame_but_not_the_counter() -> None:
    protocol, faults = loads(VALUED, "valued.yaml")
    assert protocol is not None, faults
    text = "".join(bus.generate(protocol, Options()).values())
    assert "def read(self, *, start: int = 0, component: int = 1) -> ReadResponse:" in text
    assert "component: 1..9." in text
    assert "component=component" in text
