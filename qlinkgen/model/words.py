"""Words of an enum that is sent as text."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from qlinkgen._dataclass import dataclass


@dataclass(frozen=True, slots=True)
class Words:
    """The words of an enum. Its numbers, which are not sent, are their places, from 0.

    Attributes:
        enum: name of the enum.
        words: in the order of the numbers, each of printable ASCII characters, all different.
        folded: letters of either case are received.
    """

    enum: str
    words: tuple[bytes, ...]
    folded: bool = False

    @property
    def least(self) -> int:
        """Characters that are sent at least."""
        return min(map(len, self.words))

    @property
    def most(self) -> int:
        """Maximum number of characters."""
        return max(map(len, self.words))

    @property
    def fixed(self) -> bool:
        """Whether the number of characters is constant."""
        return self.least == self.most

    @property
    def shortest(self) -> int:
        """Minimum number of characters that are received."""
        return self.least

    @property
    def lowest(self) -> int:
        """The number of the first word."""
        return 0

    @property
    def highest(self) -> int:
        """The number of the last word."""
        return len(self.words) - 1

    @property
    def alphabet(self) -> frozenset[int]:
        """The bytes of a text."""
        return frozenset(b"".join(cased(self.words, folded=self.folded)))

    @property
    def wrong(self) -> bytes:
        """A text of the greatest size that is not one of the words."""
        octets = (bytes((each,)) * self.most for each in range(0x21, 0x7F))
        return next((each for each in octets if self.number(each) is None), b"\0" * self.most)

    def text(self, number: int) -> bytes:
        """The word of a number from 0 to ``highest``."""
        return self.words[number]

    def number(self, text: bytes) -> int | None:
        """The number of a word, None for other text."""
        words = [each.upper() for each in self.words] if self.folded else self.words
        text = text.upper() if self.folded else text
        return words.index(text) if text in words else None

    def __str__(self) -> str:
        """The size of the text as written in a schema."""
        return f"text[{self.least}]" if self.fixed else f"text[{self.least}..{self.most}]"


def cased(words: Iterable[bytes], *, folded: bool) -> Iterator[bytes]:
    """The words, in both cases if they are ``folded``."""
    for word in words:
        yield from (word.upper(), word.lower()) if folded else (word,)
