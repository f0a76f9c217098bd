"""Sections of docs/soak.md, which the soaks put there one by one."""

from __future__ import annotations

import re


def put_section(page: str, title: str, text: str) -> str:
    """Return a page with a section, in place of the one with this title or at the end.

    Args:
        page: the page.
        title: heading with its ``##``.
        text: the section without its heading.
    """
    section = f"\n\n{title}\n\n{text}".rstrip("\n")
    old = re.compile(rf"\n*^{re.escape(title)}\n.*?(?=\n\n## |\Z)", re.DOTALL | re.MULTILINE)
    if old.search(page):
        return old.sub(lambda _: section, page).rstrip("\n") + "\n"
    return page.rstrip("\n") + section + "\n"
