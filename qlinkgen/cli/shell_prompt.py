"""The line editor of ``qlinkgen shell`` on a terminal; the only module that imports prompt_toolkit."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from prompt_toolkit import PromptSession
from prompt_toolkit.auto_suggest import AutoSuggestFromHistory
from prompt_toolkit.completion import CompleteEvent, Completer, Completion
from prompt_toolkit.document import Document
from prompt_toolkit.history import FileHistory

from qlinkgen.cli.shell_lines import Lines, Reader


class Offers(Completer):
    """Offers what `Lines.complete` returns."""

    def __init__(self, lines: Lines) -> None:
        self._lines = lines

    def get_completions(
        self,
        document: Document,
        complete_event: CompleteEvent,  # noqa: ARG002  # the interface of prompt_toolkit
    ) -> Iterator[Completion]:
        """Yield the completions of the last word."""
        last, items = self._lines.complete(document.text_before_cursor)
        for item in items:
            yield Completion(item.value, -len(last), display_meta=item.help or "")


def reader(lines: Lines, history: Path) -> Reader:
    """Return a function that reads a line with completion; the history is kept in a file."""
    history.parent.mkdir(parents=True, exist_ok=True)
    session: PromptSession[str] = PromptSession(
        completer=Offers(lines),
        history=FileHistory(str(history)),
        auto_suggest=AutoSuggestFromHistory(),
        complete_while_typing=False,
    )

    def read(prompt: str) -> str:
        while True:
            try:
                return session.prompt(prompt)
            except KeyboardInterrupt:  # Ctrl-C discards the line
                continue

    return read
