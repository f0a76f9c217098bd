"""Second pass, codings: builds them, and checks their bytes and the parts they apply to."""

from __future__ import annotations

from collections.abc import Sequence

from qlinkgen.model.coding import Add, Cobs, Coding, Digits, Escape, Insert, Pair
from qlinkgen.model.frame import Part
from qlinkgen.schema.file_frames import Codings, CodingSpec
from qlinkgen.schema.notation import byte_string
from qlinkgen.schema.parts import PartBuilder
from qlinkgen.schema.report import Reporter, listed
from qlinkgen.schema.source import Path
from qlinkgen.schema.stuffing import check_end

#: The key that names a coding, and the keys that complete it.
_KINDS = {
    "escape": ("xor", "of"),
    "replace": (),
    "insert": ("after",),
    "cobs": (),
    "digits": (),
    "pair": (),
    "add": (),
}

#: Receivers compare the last bytes as one number.
_LONGEST_PATTERN = 4


class CodingBuilder:
    """Builds the codings of one frame."""

    def __init__(
        self, parts: Sequence[Part], builder: PartBuilder, report: Reporter, path: Path, *, silent: bool
    ) -> None:
        """``parts`` are those of the frame at a path; ``silent``: an idle line alone ends it."""
        self._frame = path
        self._path: Path = (*path, "coding")
        self._silent = silent
        self._parts = parts
        self._builder = builder
        self._report = report

    def build(self, spec: Codings | None) -> tuple[tuple[Coding, ...], tuple[str, ...], bool]:
        """The codings in order, the names of coded parts, and whether check values cover coded bytes."""
        if spec is None:
            return (), (), False
        if spec == []:
            self._error(self._path, "the list of codings is empty", "write at least one, or remove the key")
            return (), (), False
        many = isinstance(spec, list)
        specs = spec if isinstance(spec, list) else [spec]
        if not self._known:
            self._check_open(specs)
        after = [index for index, each in enumerate(specs) if each.checked == "after"]
        for index in after:
            self._check_after(specs[index], (*self._path, index) if many else self._path)
        codings = [
            self._coding(each, (*self._path, index) if many else self._path)
            for index, each in enumerate(specs)
        ]
        for index, coding in enumerate(codings[:-1]):
            if isinstance(coding, Cobs):
                self._error(
                    (*self._path, index), "COBS is followed by another coding", "move cobs to the end"
                )
        coded = self._coded(None, self._path)
        if after:
            coded = tuple(part.name for part in self._parts if part.role == "payload")
        given = [(each.over, index) for index, each in enumerate(specs) if each.over is not None]
        for over, index in given:
            path: Path = (*self._path, index, "over") if many else (*self._path, "over")
            if over != given[0][0]:
                what = "codings of one frame apply to different parts"
                self._error(path, what, "name the same parts in each, or only in one")
            else:
                coded = self._coded(over, path)
                self._check_start(coded, codings, path)
        return tuple(each for each in codings if each is not None), coded, bool(after)

    @property
    def _known(self) -> bool:
        """Whether the end of a frame is known before it is decoded."""
        return self._silent or any(part.role == "terminator" for part in self._parts)

    def _check_open(self, specs: Sequence[CodingSpec]) -> None:
        """Check that a receiver can decode as it reads, since nothing tells the end before."""
        wrong = ""
        if len(specs) > 1:
            wrong = "several codings"
        elif specs[0].cobs is not None:
            wrong = "COBS"
        if wrong:
            what = f"{wrong} cannot be decoded before the end of a frame is known"
            hint = "add a part with role: terminator"
            needs = (self._path, (*self._frame, "parts"))
            self._report.error("not-applicable", self._path, what, hint, of_key=True, needs=needs)

    def _check_after(self, spec: CodingSpec, path: Path) -> None:
        """Check that check values can cover coded bytes: those of a payload with a length."""
        place = (*path, "checked")
        payload = next(part.name for part in self._parts if part.role == "payload")
        if self._known:
            what = "check values of a frame with a terminator or a silence cover the bytes before the coding"
            self._error(place, what, "remove checked: after")
        elif spec.insert is None and spec.add is None:
            what = "check values cover the coded bytes only of insert and add"
            self._error(place, what, "remove checked: after")
        elif spec.over is not None and spec.over != [payload]:
            what = "lengths and check values cannot cover bytes of themselves"
            self._error((*path, "over"), what, f"write over: [{payload}]")
        else:
            check_end(self._parts, place, (*self._frame, "parts"), self._report)

    def _error(self, path: Path, what: str, hint: str) -> None:
        self._report.error("bad-coding", path, what, hint, of_key=True)

    def _check_start(self, coded: Sequence[str], codings: Sequence[Coding | None], path: Path) -> None:
        """Check that the first constant is sent as it is: receivers search for it before they decode.

        Stuffing may cover it, as it never changes the first byte.
        """
        start = self._parts[0]
        stuffed = not self._known and isinstance(codings[0], Insert)
        if start.role == "constant" and start.name in coded and not stuffed:
            what = f"'{start.name}' is coded, but receivers search for it as it is sent"
            self._error(path, what, f"name all but {start.name}, and give it the bytes that are sent")

    # Parts

    def _coded(self, over: Sequence[str] | None, path: Path) -> tuple[str, ...]:
        roles = [part.role for part in self._parts]
        end = roles.index("terminator") if "terminator" in roles else len(roles)
        inner = self._parts[int(roles[0] == "constant") : end]
        if over is None:
            return tuple(part.name for part in inner)
        names = [part.name for part in self._parts]
        self._builder.known(over, names, path)
        if any(name not in names for name in over):
            return ()
        places = [names.index(name) for name in over]
        if places != list(range(places[0], places[0] + len(places))) if places else True:
            self._error(path, "coded parts are not adjacent", "name all parts from the first to the last")
        elif roles.index("payload") not in places or places[-1] >= end:
            what = "coded parts must include the payload and precede the terminator"
            self._error(path, what, f"name some of {listed(part.name for part in inner)}")
        return tuple(over)

    # Bytes

    def _coding(self, spec: CodingSpec, path: Path) -> Coding | None:
        given = [kind for kind in _KINDS if getattr(spec, kind) is not None]
        if len(given) != 1:
            what = f"a coding has {listed(given)}" if given else "a coding has no kind"
            hint = f"write exactly one of {listed(_KINDS, 'or')}; several are a list"
            if not self._report.incomplete(path):
                self._error(path, what, hint)
            return None
        kind = given[0]
        for key in _KINDS[kind]:
            if getattr(spec, key) is None:
                self._error(path, f"{kind} has no {key}", f"add {key}")
                return None
        others = {key for keys in _KINDS.values() for key in keys} - set(_KINDS[kind])
        for key in sorted(others & spec.model_fields_set):
            self._error((*path, key), f"'{key}' has no effect on {kind}", "remove it")
        return self._of_kind(kind, spec, path)

    def _of_kind(self, kind: str, spec: CodingSpec, path: Path) -> Coding | None:
        simple: dict[str, Coding] = {"cobs": Cobs(), "digits": Digits(), "pair": Pair()}
        if kind in simple:
            if kind == "cobs" and spec.cobs != b"\0":
                self._error((*path, "cobs"), "COBS removes zero bytes", "write cobs: 00")
            return simple[kind]
        if kind == "insert":
            after = spec.after or b"\0"
            if len(after) > _LONGEST_PATTERN:
                what = f"a pattern of {len(after)} bytes is too long"
                self._error((*path, "after"), what, f"use at most {_LONGEST_PATTERN} bytes")
            return Insert(after, self._byte(spec.insert, (*path, "insert")))
        if kind == "add":
            return Add(self._byte(spec.add, (*path, "add")))
        return self._escape(spec, path) if kind == "escape" else self._replace(spec, path)

    def _byte(self, data: bytes | None, path: Path) -> int:
        if data is not None and len(data) != 1:
            self._error(path, f"{len(data)} bytes are given in place of one", "write one byte, like 0x7D")
        return data[0] if data else 0

    def _escape(self, spec: CodingSpec, path: Path) -> Coding | None:
        escape, mask = self._byte(spec.escape, (*path, "escape")), self._byte(spec.xor, (*path, "xor"))
        marked = [self._byte(each, (*path, "of", index)) for index, each in enumerate(spec.of or ())]
        codes = {byte: byte ^ mask for byte in marked}
        if mask == 0:
            self._error((*path, "xor"), "xor 00 would send escaped bytes as they are", "write another byte")
            return None
        return self._checked(Escape(escape, tuple(codes.items()), mask), (*path, "of"))

    def _replace(self, spec: CodingSpec, path: Path) -> Coding | None:
        codes: dict[int, int] = {}
        escapes: set[int] = set()
        for key, sent in (spec.replace or {}).items():
            place = (*path, "replace", key)
            try:
                byte = byte_string(int(key, 16) if key.startswith("0x") else key)
            except ValueError:
                byte = b""
            if len(byte) != 1 or len(sent) != 2:
                self._error(place, "a byte is replaced by two bytes", "write it like C0: DB DC")
                return None
            codes[byte[0]] = sent[1]
            escapes.add(sent[0])
        if len(escapes) != 1:
            what = "replacements begin with different bytes" if escapes else "no byte is replaced"
            self._error((*path, "replace"), what, "begin each with the same byte, which is replaced as well")
            return None
        return self._checked(Escape(escapes.pop(), tuple(codes.items())), (*path, "replace"))

    def _checked(self, coding: Escape, path: Path) -> Coding | None:
        """The coding if coded bytes can be decoded."""
        seconds = [second for _, second in coding.codes]
        if coding.escape not in dict(coding.codes):
            what = f"{coding.escape:02X}, which begins two bytes, is not among the bytes that are replaced"
            self._error(path, what, f"add {coding.escape:02X}")
            return None
        if len(set(seconds)) < len(seconds):
            self._error(path, "two bytes are sent alike", "let the second bytes differ")
            return None
        if both := sorted(set(seconds) & dict(coding.codes).keys()):
            what = f"{both[0]:02X} is the second of two bytes, but is replaced itself"
            self._error(path, what, "use second bytes that are not replaced")
            return None
        return coding
