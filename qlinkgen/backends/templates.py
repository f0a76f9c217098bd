"""Templates of the back-ends, and their compiled form.

To compile the templates takes a fifth of the time of `generate`. So their code is kept where Python keeps
that of modules, in `__pycache__` beside them, and under the same conditions: it is written if that folder can
be, and used as long as template, versions and settings are the same.
"""

from __future__ import annotations

import hashlib
import importlib.resources
import importlib.util
import os
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Final, TypedDict

import jinja2
from jinja2.bccache import Bucket


class _Settings(TypedDict):
    trim_blocks: bool
    lstrip_blocks: bool
    keep_trailing_newline: bool
    autoescape: bool


#: The output is source text, not HTML.
_SETTINGS: Final = _Settings(
    trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True, autoescape=False
)


def environment(package: str) -> jinja2.Environment:
    """Templates from the package of a back-end; undefined names are errors."""
    folder = importlib.resources.files(package)
    return jinja2.Environment(
        loader=jinja2.FunctionLoader(lambda name: folder.joinpath(name).read_text("utf-8")),
        undefined=jinja2.StrictUndefined,
        bytecode_cache=CompiledTemplates(folder) if isinstance(folder, Path) else None,
        **_SETTINGS,
    )


def _jinja() -> str:
    """Return the version of Jinja: by the name of a folder, since reading its metadata takes 20 ms."""
    known = Path(jinja2.__file__).parents[1].glob("[jJ]inja2-*.dist-info")
    if names := sorted(each.name for each in known):
        return " ".join(names)
    from importlib.metadata import version  # noqa: PLC0415  # see above

    return version("jinja2")


class CompiledTemplates(jinja2.BytecodeCache):
    """The compiled templates of a folder."""

    def __init__(self, folder: Path) -> None:
        """Keep them beside the templates of the folder."""
        self._folder = folder
        made_with = f"{_jinja()} {sorted(_SETTINGS.items())}"
        self._tag = f"jinja{hashlib.sha256(made_with.encode()).hexdigest()[:12]}"

    def get_cache_key(self, name: str, filename: str | None = None) -> str:  # noqa: ARG002  # Jinja passes it
        """Return the name of the template, which is its path in the folder."""
        return name

    def load_bytecode(self, bucket: Bucket) -> None:
        """Fill a bucket from its file, if there is one; Jinja compares the text of the template."""
        with suppress(OSError), self._file(bucket).open("rb") as file:
            bucket.load_bytecode(file)

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Write a bucket, in one step, unless Python is not to write compiled modules or cannot."""
        if sys.dont_write_bytecode:
            return
        file = self._file(bucket)
        with suppress(OSError):
            file.parent.mkdir(exist_ok=True)
            handle, temporary = tempfile.mkstemp(dir=file.parent)
            try:
                with os.fdopen(handle, "wb") as opened:
                    bucket.write_bytecode(opened)
                Path(temporary).replace(file)
            except OSError:
                Path(temporary).unlink()
                raise

    def _file(self, bucket: Bucket) -> Path:
        path = self._folder / bucket.key
        return Path(importlib.util.cache_from_source(str(path), optimization=self._tag))
