"""``qlinkgen crc``: list check values, or find those that fit frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

import click

from qlinkgen._dataclass import dataclass
from qlinkgen.cli.boundary import FINE, WRONG, Failure
from qlinkgen.cli.common import parse_hex, warn
from qlinkgen.cli.crc_unknown import Recovered, recover
from qlinkgen.cli.tables import Table, heading
from qlinkgen.model.checksum import Checksum, of_width

#: Sizes of check values in bytes, those that rarely match by chance first.
_SIZES = (8, 4, 3, 2, 1)
#: Bytes before the covered ones, and after the check value.
_LEADS, _ENDS = 9, 3
#: Matches to show.
_SHOWN = 20
#: Fewer bits of all check values together match by chance.
_CERTAIN = 24


@dataclass(frozen=True, slots=True)
class _Fit:
    """A check value of ``size`` bytes, ``end`` bytes before the end of frames, that skips ``lead`` bytes."""

    algorithm: Checksum
    size: int
    order: Literal["big", "little"]
    lead: int
    end: int

    @property
    def oddity(self) -> tuple[int, int, int]:
        """Likelier fits have less."""
        return self.end, self.lead, -self.size

    def holds(self, frame: bytes) -> bool:
        """Whether the check value of a frame is right; frames without covered bytes have none."""
        at = len(frame) - self.end - self.size
        if at <= self.lead:
            return False
        value = int.from_bytes(frame[at : at + self.size], self.order)
        return self.algorithm.compute(frame[self.lead : at]) == value


@click.command("crc")
@click.argument("hex_", metavar="list | HEX...", nargs=-1, required=True)
@click.option("--width", type=click.Choice(["8", "16", "24", "32", "64"]), help="Only those of so many bits.")
def command(hex_: tuple[str, ...], width: str | None) -> int:
    """List the check values that schemas can name, or find those that fit all the given frames.

    If none fits, the parameters of a CRC are computed: this takes three frames of one length, or two pairs,
    and frames of three lengths in all to tell init and xorout apart.

    Each HEX is one whole frame, in quotes if it has blanks. The check value is searched at the end of the
    frames, in both byte orders, before up to two other bytes, and over the bytes before it except the first
    ones. Exit code 1 if none fits.

    \b
    qlinkgen crc list --width 16
    qlinkgen crc "01 03 00 6B 00 03 74 17" 010300000002c40b
    """  # noqa: D301  # click takes the character \b for "do not wrap"
    sizes = [size for size in _SIZES if width in (None, str(8 * size))]
    if hex_ == ("list",):
        _list(sorted(sizes))
        return FINE
    frames = [parse_hex(each) for each in hex_]
    if not all(frames):
        raise Failure("HEX is empty; give the bytes of a frame")
    fits = sorted(_fits(frames, sizes), key=lambda fit: fit.oddity)
    if fits:
        _show(fits, frames)
        return FINE
    if own := recover(frames, sizes):
        _show_own(own, frames)
        return FINE
    click.echo("no check value fits: give whole frames, each in quotes")
    click.echo("for a CRC without a name: at least three frames of one length, and some of two others")
    return WRONG


def _list(sizes: Sequence[int]) -> None:
    table = Table(["algorithm", "bits", "check", "also called"], right=frozenset({"bits"}))
    for size in sizes:
        for each in of_width(8 * size):
            table.add(each.name, each.width, f"{each.check:0{2 * size}X}", ", ".join(each.aliases))
    heading("Check values by name; check is that of the characters 123456789")
    table.show()


def _fits(frames: Sequence[bytes], sizes: Sequence[int]) -> Iterator[_Fit]:
    for size in sizes:
        orders: tuple[Literal["big", "little"], ...] = ("big", "little") if size > 1 else ("big",)
        for algorithm in of_width(8 * size):
            for order in orders:
                tried = (
                    _Fit(algorithm, size, order, lead, end) for lead in range(_LEADS) for end in range(_ENDS)
                )
                yield from (fit for fit in tried if all(map(fit.holds, frames)))


def _show_own(own: Recovered, frames: Sequence[bytes]) -> None:
    crc, place = own.algorithm, own.place
    digits = 2 * place.size
    click.echo("a CRC that has no name in the catalogue fits; in a schema:")
    reflected = "true" if crc.refin else "false"
    click.echo(
        f"  algorithm: {{width: {crc.width}, poly: 0x{crc.poly:0{digits}X}, init: 0x{crc.init:0{digits}X}, "
        f"refin: {reflected}, refout: {reflected}, xorout: 0x{crc.xorout:0{digits}X}}}"
    )
    if place.size > 1:
        click.echo(f"  byteorder: {place.order}")
    covers = f"all before it from byte {place.lead} on" if place.lead else "all before it"
    click.echo(f"it covers {covers}; {place.end} bytes follow it")
    if own.open_bits:
        lengths = len({len(each) for each in frames})
        warn(
            f"{own.open_bits} bits of init and xorout are open: frames of {lengths} "
            f"length{'' if lengths == 1 else 's'} fit other values too; give frames of further lengths"
        )


def _show(fits: Sequence[_Fit], frames: Sequence[bytes]) -> None:
    table = Table(["algorithm", "bytes", "order", "covers", "after it"])
    for fit in fits[:_SHOWN]:
        covers = f"all before it from byte {fit.lead} on" if fit.lead else "all before it"
        after = f"{fit.end} bytes follow" if fit.end > 1 else "1 byte follows" if fit.end else ""
        table.add(fit.algorithm.name, fit.size, fit.order if fit.size > 1 else "", covers, after)
    table.show()
    if len(fits) > _SHOWN:
        click.echo(f"and {len(fits) - _SHOWN} more")
    if len(fits) > 1 and 8 * fits[0].size * len(frames) < _CERTAIN:
        warn("short check values match by chance; give more frames of different messages")
