"""Rules for floating-point numbers, lists of any values, and padded values.

Copied next to the modules that need it, unchanged.
"""

from __future__ import annotations

from struct import pack

from ._support import BytesRule, Rule

TYPE_CHECKING = False  # as typing.TYPE_CHECKING; importing `typing` costs 5 ms
if TYPE_CHECKING:
    from ._support import Value

_FORMATS = {16: "<e", 32: "<f", 64: "<d"}


class FloatRule(Rule):
    """A floating-point number of 16, 32 or 64 bits, in a range if it has bounds."""

    __slots__ = ("bits", "bounds")

    def __init__(self, name: str, bits: int, *bounds: float, unit: str = "") -> None:
        self.bits = bits
        self.bounds = bounds
        range_ = f", {bounds[0]}..{bounds[1]}" if bounds else ""
        super().__init__(name, f"a number of {bits} bits{range_}{unit and ' '}{unit}")

    def allows(self, value: Value) -> bool:
        """Whether the value is a number that fits, and in range."""
        pack(_FORMATS[self.bits], value)
        return not self.bounds or bool(self.bounds[0] <= value <= self.bounds[1])

    def plain(self, value: Value) -> float:
        """The value as a float."""
        return float(value)


class ListRule(Rule):
    """A list of values that a rule allows."""

    __slots__ = ("fewest", "item", "most")

    def __init__(self, fewest: int, most: int, item: Rule) -> None:
        self.fewest = fewest
        self.most = most
        self.item = item
        size = str(most) if fewest == most else f"{fewest}..{most}"
        super().__init__(item.name, f"a list of {size} items, each {item.legal}")

    def allows(self, value: Value) -> bool:
        """Whether the number of items is legal, and all items are."""
        return self.fewest <= len(value) <= self.most and all(
            self.item.allows(item) for item in value
        )

    def plain(self, value: Value) -> Value:
        """The value as a list of plain values."""
        items = [self.item.plain(item) for item in value]
        same = all(new is old for new, old in zip(items, value, strict=True))
        return value if same and value.__class__ is list else items


class PaddedRule(Rule):
    """Bytes or text that are filled up with a byte, with which the value does not end."""

    __slots__ = ("pad", "rule")

    def __init__(self, rule: Rule, pad: bytes) -> None:
        self.rule = rule
        self.pad = pad
        super().__init__(rule.name, f"{rule.legal} that do not end with {pad.hex()}")

    def allows(self, value: Value) -> bool:
        """Whether the value is legal, and does not end with the byte."""
        data = value.encode() if isinstance(value, str) else bytes(value)
        return self.rule.allows(value) and not data.endswith(self.pad)


class WithoutRule(BytesRule):
    """Bytes without the one that ends them."""

    __slots__ = ("excluded",)

    def __init__(self, name: str, fewest: int, most: int, excluded: bytes) -> None:
        super().__init__(name, fewest, most)
        self.excluded = excluded
        self.legal += f" without {excluded.hex()}"

    def allows(self, value: Value) -> bool:
        """Whether the value has a legal size, and not that byte."""
        return super().allows(value) and not {*self.excluded} & {*bytes(value)}
