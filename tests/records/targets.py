"""Payloads of a schema in the interpreter of the plan, generated Python and construct."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import pytest
from construct import ConstructError

from qlinkgen.backends import construct, python
from qlinkgen.model.protocol import Protocol
from qlinkgen.plan import plan_of
from qlinkgen.plan.content import BadContent, Raw, pack, unpack
from qlinkgen.plan.payload import PayloadPlan
from qlinkgen.schema import loads


class Targets:
    """Each of them is made when a test first asks for it."""

    def __init__(self, schema: str) -> None:
        self._schema = schema

    @cached_property
    def protocol(self) -> Protocol:
        found, faults = loads(self._schema, "sample.yaml")
        assert found is not None, faults
        return found

    @cached_property
    def module(self) -> Any:
        return python.load(self.protocol)

    @cached_property
    def live(self) -> construct.Live:
        return construct.live(self.protocol)

    def payload(self, name: str) -> PayloadPlan:
        return plan_of(self.protocol).message(name).payload

    def check_both_ways(self, name: str, values: Mapping[str, Raw], wire: bytes) -> None:
        payload, parsed = self.payload(name), self.live.messages[name].parse(wire)
        assert pack(payload, values) == wire
        assert unpack(payload, wire) == values
        assert self.module.MESSAGES[name].from_bytes(wire).to_bytes() == wire
        assert self.live.payload(name, parsed) == wire

    def check_refused(self, name: str, wire: bytes, kind: str) -> None:
        with pytest.raises(BadContent) as caught:
            unpack(self.payload(name), wire)
        assert caught.value.kind == kind
        with pytest.raises(self.module.DecodeError) as refused:
            self.module.MESSAGES[name].from_bytes(wire)
        assert refused.value.kind == kind
        with pytest.raises(ConstructError):
            self.live.messages[name].parse(wire)

    def check_fault_at(self, name: str, wire: bytes, field: str, offset: int) -> None:
        with pytest.raises(BadContent) as caught:
            unpack(self.payload(name), wire)
        assert (caught.value.field, caught.value.offset) == (field, offset)
        with pytest.raises(self.module.DecodeError) as refused:
            self.module.MESSAGES[name].from_bytes(wire)
        assert (refused.value.field, refused.value.offset) == (field, offset)
