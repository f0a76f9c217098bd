"""Second pass, algorithms of check values: by name, or by the parameters of a CRC."""

from __future__ import annotations

from qlinkgen.model import checksum as catalogue
from qlinkgen.schema.file_algorithms import AnyAlgorithm, CrcSpec
from qlinkgen.schema.notation import shown
from qlinkgen.schema.report import Reporter, listed
from qlinkgen.schema.source import Path


class AlgorithmBuilder:
    """Finds the algorithms of check values."""

    def __init__(self, report: Reporter) -> None:
        self._report = report

    def build(self, stated: AnyAlgorithm, init: int | None, path: Path) -> catalogue.Checksum | None:
        """The algorithm of a part or field; None if it is unknown. ``init`` replaces its start."""
        if isinstance(stated, CrcSpec):
            algorithm: catalogue.Checksum | None = self._parameters(stated, (*path, "algorithm"))
        else:
            algorithm = self._named(stated, path)
        return algorithm if algorithm is None or init is None else self._begun(algorithm, init, path)

    def _begun(self, algorithm: catalogue.Checksum, init: int, path: Path) -> catalogue.Checksum:
        """The algorithm with another initial register."""
        try:
            return catalogue.begun(algorithm, init)
        except ValueError:
            what = f"{init:#x} does not fit {algorithm.width} bits"
            hint = f"use 0..{algorithm.mask:#x}"
            self._report.error("value-does-not-fit", (*path, "init"), what, hint)
            return algorithm

    def _ambiguous(self, name: str, found: catalogue.Checksum | None, path: Path) -> bool:
        """Report an ambiguous name; ``found`` is what it was taken as."""
        candidates = catalogue.candidates(name)
        if candidates:
            what = f"{shown(name)} is ambiguous" + (f" and was taken as {found.name}" if found else "")
            names = listed((f"{each.name} ({each.check:0{each.width // 4}X})" for each in candidates), "or")
            hint = f"write the one whose check value for 123456789 matches the document: {names}"
            rule = "ambiguous-algorithm" if found else "unknown-algorithm"
            self._report.error(rule, (*path, "algorithm"), what, hint)
        return bool(candidates)

    def _named(self, name: str, path: Path) -> catalogue.Checksum | None:
        try:
            found = catalogue.find(name[:80])
            self._ambiguous(name, found, path)
            return found
        except catalogue.UnknownAlgorithm as error:
            if self._ambiguous(name, None, path):
                return None
            hint = "see the catalogue of CRC algorithms, or use sum8, xor8 or another sum"
            if error.suggestions:
                hint = f"did you mean {listed(map(repr, error.suggestions), 'or')}?"
            what = f"unknown checksum algorithm {shown(name)}"
            self._report.error("unknown-algorithm", (*path, "algorithm"), what, hint)
            return None

    def _parameters(self, spec: CrcSpec, path: Path) -> catalogue.Algorithm | None:
        """The CRC with parameters of its own."""
        refout = spec.refin if spec.refout is None else spec.refout
        try:
            found = catalogue.stated(
                spec.width, spec.poly, spec.init, refin=spec.refin, refout=refout, xorout=spec.xorout
            )
        except ValueError as error:
            what, hint = str(error).partition(": ")[2], "correct it"
            if "poly" in what:
                hint = "write it unreflected and without its highest term, like 0x1021"
            self._report.error("crc-parameters", path, what, hint)
            return None
        if spec.check is not None and spec.check != found.check:
            digits = spec.width // 4
            what = f"the CRC of 123456789 is 0x{found.check:0{digits}X}, not 0x{spec.check:0{digits}X}"
            hint = "correct a parameter, most often init, refin or xorout"
            self._report.error("crc-parameters", (*path, "check"), what, hint)
        return found
