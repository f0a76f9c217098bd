"""The check value: forms of a CRC, the catalogue to choose from, tables as literals."""

from __future__ import annotations

from typing import Any

from qlinkgen.backends.c.names import unsigned, unsigned_type
from qlinkgen.errors import GenerationError
from qlinkgen.model.checksum import Algorithm, Sum, catalogue
from qlinkgen.model.frame import Checksum


def algorithm_macro(algorithm: Algorithm) -> str:
    """``crc-16/ibm-3740`` as the tail of a macro's name: ``CRC_16_IBM_3740``."""
    return "".join(c if c.isalnum() else "_" for c in algorithm.name).upper()


def render(checksum: Checksum | None) -> dict[str, Any] | None:
    """The check value for the template."""
    if checksum is None:
        return None
    if isinstance(checksum.algorithm, Sum):
        return _render_sum(checksum.algorithm, checksum)
    return _render_crc(checksum.algorithm, checksum)


def _render_sum(algorithm: Sum, checksum: Checksum) -> dict[str, Any]:
    return {
        "is_crc": False,
        "name": algorithm.name,
        "width": algorithm.width,
        "type": unsigned_type(algorithm.width),
        "start": "0U",
        "finished": f"({unsigned_type(algorithm.width)})~sum" if algorithm.complement else "sum",
        "choices": [],
        "selectable": False,
        "mask": _sent_mask(checksum),
    }


def _render_crc(algorithm: Algorithm, checksum: Checksum) -> dict[str, Any]:
    if algorithm.refin != algorithm.refout or algorithm.width not in (8, 16, 24, 32, 64):
        raise GenerationError(f"{algorithm.name}: C has no form for this CRC; use one of whole bytes")
    width = algorithm.width
    return {
        "is_crc": True,
        "name": algorithm.name,
        "macro": algorithm_macro(algorithm),
        "width": width,
        "type": unsigned_type(width),
        "selectable": width == 16,
        "choices": [_choice(each) for each in catalogue(16)] if width == 16 else [],
        "poly": unsigned(algorithm.poly, width, hexadecimal=True),
        "feedback": unsigned(algorithm.feedback, width, hexadecimal=True),
        "start": unsigned(algorithm.start, width, hexadecimal=True),
        "xorout": unsigned(algorithm.xorout, width, hexadecimal=True),
        "reflected": int(algorithm.refin),
        **_byte_steps(width),
        "top": unsigned(1 << (width - 1), width, hexadecimal=True),
        "nibble_shift": width - 4,
        "nibble_rows": _rows(algorithm, 4),
        "rows": _rows(algorithm, 8),
        "mask": _sent_mask(checksum),
    }


def _byte_steps(width: int) -> dict[str, str]:
    """How a byte enters the register; 24 bits lie in a wider type, and 8 bits shift out completely."""
    kind = unsigned_type(width)
    return {
        "shifted_down": "" if width == 8 else "(crc >> 8) ^ ",
        "shifted_up": "" if width == 8 else "(crc << 8) ^ ",
        "top_byte": "crc" if width == 8 else f"(crc >> {width - 8})",
        "placed_byte": "byte" if width == 8 else f"({kind})(({kind})byte << {width - 8})",
        "mask_open": "(" if width == 24 else "",
        "mask_close": ") & 0x00FFFFFFUL" if width == 24 else "",
        "flash_read": {8: "pgm_read_byte", 16: "pgm_read_word"}.get(width, "pgm_read_dword"),
    }


def _sent_mask(checksum: Checksum) -> str | None:
    """A mask where not every bit is sent."""
    width = checksum.algorithm.width
    return None if checksum.mask == (1 << width) - 1 else unsigned(checksum.mask, width, hexadecimal=True)


def _choice(algorithm: Algorithm) -> dict[str, str]:
    width = algorithm.width
    numbers = [unsigned(value, width, hexadecimal=True) for value in (algorithm.poly, algorithm.init)]
    numbers += [str(int(algorithm.refin)), unsigned(algorithm.xorout, width, hexadecimal=True)]
    return {
        "macro": algorithm_macro(algorithm),
        "tuple": ", ".join(numbers),
        "check": f"0x{algorithm.check:0{width // 4}X}",
    }


def _rows(algorithm: Algorithm, bits: int) -> list[str]:
    entries = [unsigned(entry, algorithm.width, hexadecimal=True) for entry in algorithm.table(bits)]
    return [", ".join(entries[index : index + 8]) for index in range(0, len(entries), 8)]
