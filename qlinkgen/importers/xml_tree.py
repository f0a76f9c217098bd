"""Reads XML into elements with their lines; document types, and with them entities, are refused."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from xml.parsers import expat

from qlinkgen.errors import ImportFileError
from qlinkgen.importers.notes import Notes

_DEEPEST, _MOST = 30, 500_000


@dataclass(slots=True)
class Element:
    """An element.

    Attributes:
        name: Its tag.
        attributes: Attributes by name.
        line: Line of the tag.
        text: Text directly inside it, in one piece.
        children: Elements inside it.
    """

    name: str
    attributes: Mapping[str, str]
    line: int
    text: str = ""
    children: list[Element] = field(default_factory=list)

    def get(self, attribute: str) -> str:
        """An attribute, empty if it is absent."""
        return self.attributes.get(attribute, "")

    def all(self, name: str) -> Iterator[Element]:
        """The children of a name."""
        return (each for each in self.children if each.name == name)

    def has(self, name: str) -> bool:
        """Whether there is a child of a name."""
        return any(each.name == name for each in self.children)

    def text_of(self, name: str) -> str:
        """The text of the first child of a name, empty if there is none."""
        return next((each.text for each in self.all(name)), "")


def parse_xml(data: bytes, notes: Notes) -> Element:
    """The root element.

    Raises:
        ImportFileError: the bytes are not XML, have a document type, or are nested too deep.
    """
    builder = _Builder(notes)
    try:
        builder.parser.Parse(data, True)  # expat's interface
    except expat.ExpatError as error:
        raise notes.error(error.lineno, f"this is not XML: {expat.ErrorString(error.code)}") from None
    except ImportFileError:
        raise
    except (LookupError, ValueError) as error:  # of codecs
        raise notes.error(1, f"the encoding of this XML cannot be read: {error}") from None
    assert builder.root is not None  # expat refuses a document without one
    return builder.root


class _Builder:
    """Collects elements."""

    def __init__(self, notes: Notes) -> None:
        self._notes = notes
        self._open: list[Element] = []
        self._texts: list[list[str]] = []
        self._made = 0
        self.root: Element | None = None
        self.parser = expat.ParserCreate()
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._characters
        self.parser.StartDoctypeDeclHandler = self._doctype

    def _doctype(self, *_: object) -> None:
        line = self.parser.CurrentLineNumber
        raise self._notes.error(line, "a document type declaration is refused: it may define entities")

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        line = self.parser.CurrentLineNumber
        self._made += 1
        if len(self._open) >= _DEEPEST:
            raise self._notes.error(line, f"elements are nested more than {_DEEPEST} deep")
        if self._made > _MOST:
            raise self._notes.error(line, f"more than {_MOST} elements")
        element = Element(name, attributes, line)
        if self._open:
            self._open[-1].children.append(element)
        else:
            self.root = element
        self._open.append(element)
        self._texts.append([])

    def _end(self, _: str) -> None:
        self._open.pop().text = " ".join("".join(self._texts.pop()).split())

    def _characters(self, text: str) -> None:
        self._texts[-1].append(text)
