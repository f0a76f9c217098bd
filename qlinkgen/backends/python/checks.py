"""Checksums of frames: definitions in the generated module."""

from __future__ import annotations

from qlinkgen.model.checksum import Algorithm
from qlinkgen.model.frame import Checksum
from qlinkgen.model.types import byte_chunks


def regular(checksum: Checksum) -> bool:
    """All bits are sent, in whole bytes of one order."""
    size = len(checksum.chunks)
    whole = checksum.algorithm.width == 8 * size
    return whole and checksum.chunks in (byte_chunks(size, "big"), byte_chunks(size, "little"))


def selectable(checksum: Checksum | None) -> bool:
    """Another algorithm of the catalogue can take its place at run time."""
    return (
        checksum is not None and isinstance(checksum.algorithm, Algorithm) and checksum.algorithm.width == 16
    )


def checksum_definition(checksum: Checksum) -> str:
    """The statement that defines the checksum of a module."""
    algorithm = checksum.algorithm
    if not isinstance(algorithm, Algorithm):
        complement = ", complement=True" if algorithm.complement else ""
        return f'_checksum = sum_of("{algorithm.name}", {algorithm.width}{complement})'
    if algorithm.width == 16:
        return f'_checksum = find_crc("{algorithm.name}")'
    digits = (algorithm.width + 3) // 4
    poly, init, xorout = (f"0x{n:0{digits}X}" for n in (algorithm.poly, algorithm.init, algorithm.xorout))
    return "\n".join(
        [
            "_checksum = crc(",
            f'    "{algorithm.name}", width={algorithm.width}, poly={poly}, init={init},',
            f"    refin={algorithm.refin}, refout={algorithm.refout}, xorout={xorout},",
            ")",
        ]
    )


def order_of(checksum: Checksum) -> str:
    """Byte order in which a regular checksum is sent."""
    return "big" if checksum.chunks == byte_chunks(len(checksum.chunks), "big") else "little"


def check_bytes(checksum: Checksum, number: str) -> str:
    """Expression for the bytes of a check value; bits that are not sent are dropped."""
    if regular(checksum):
        return f'{number}.to_bytes({len(checksum.chunks)}, "{order_of(checksum)}")'
    pieces = [
        f"{number} >> {chunk.shift} & 0x{chunk.mask:02X}" if chunk.shift else f"{number} & 0x{chunk.mask:02X}"
        for chunk in checksum.chunks
    ]
    return f"bytes(({', '.join(pieces)},))" if len(pieces) == 1 else f"bytes(({', '.join(pieces)}))"
