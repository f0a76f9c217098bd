"""The word list finds its phrases, also over line ends, and accepts the replacements."""

from __future__ import annotations

import pytest

from tests.prose import PHRASES, hits, texts

OLD = {
    "The mark stands in the header.": "stands in",
    "It is in front of the payload.": "in front of",
    "Bytes behind the\n    # end.": "behind the",
    "Nobody answers.": "Nobody",
    "# crc is\n#: no sum": "is #: no sum",
    "There is no frame.": "is no frame",
    "There are\n * no frames.": "are * no frames",
    "What came was damaged.": "What came",
    "An answer of no bytes": "of no bytes",
    "What is not there cannot be counted.": "What is not there",
    "Raises one of the misfits.": "misfits",
    "Encoding knows nothing of frames.": "knows nothing",
    "Every vector goes both ways.": "goes both ways",
    "The frame comes out at its end.": "comes out",
    "A frame is taken apart.": "taken apart",
    "The payload is left alone.": "left alone",
    "A runtime has to\n# say how.": "has to # say",
    "Node checks who it is for.": "who it is for",
    "Zeros are sent in their stead.": "in their stead",
}
NEW = """The mark is part of the header, before the payload; bytes after the end are dropped. No node
answers. The CRC is not a sum. No frame was received. The reply was damaged, and is no longer than four bytes.
A name that refers to nothing cannot be counted. Raises LayoutError. It understands that they stand still."""


@pytest.mark.parametrize(("text", "phrase"), OLD.items())
def test_listed_phrases_are_found(text: str, phrase: str) -> None:
    assert [hit.phrase for hit in hits("x.md", f"\n{text}\n")] == [phrase]
    assert hits("x.md", f"\n\n{text}")[0].line == 3


def test_every_phrase_has_an_example() -> None:
    assert {hit.advice for text in OLD for hit in hits("x.md", text)} == {*PHRASES.values()}


def test_replacements_are_accepted() -> None:
    assert hits("x.md", NEW) == []


def test_texts_are_those_of_the_project() -> None:
    paths = {path for path, _ in texts()}
    assert {"README.md", "Makefile", "qlinkgen/plan/codec.py", "tests/conftest.py"} <= paths
    assert not any(path.startswith(("generated/", "tests/prose/")) for path in paths)
