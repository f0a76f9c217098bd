"""Locates the data files of the package."""

from __future__ import annotations

from pathlib import Path

__all__ = ["cmake_dir", "library_dir", "schemas_dir"]


def schemas_dir() -> Path:
    """Return the folder of the shipped protocol descriptions.

    In a repository, and so in an editable install, that is the top-level folder `schemas`: edits take effect
    immediately. A wheel contains a copy of the folder in the package.

    Raises:
        FileNotFoundError: the installation has neither, so it is incomplete.
    """
    package = Path(__file__).resolve().parent
    # The copy first: next to an installed package, `../schemas` would be an unrelated folder.
    for folder in (package / "schemas", package.parent / "schemas"):
        if folder.is_dir():
            return folder
    raise FileNotFoundError(f"no schemas folder in {package} or next to it; reinstall qlinkgen")


def library_dir() -> Path:
    """Return the folder of the public protocols. Raises FileNotFoundError like `schemas_dir`."""
    return schemas_dir() / "library"


def cmake_dir() -> Path:
    """Return the folder of Qlinkgen.cmake: that of the firmware examples, or its copy in a wheel.

    Raises:
        FileNotFoundError: the installation has neither, so it is incomplete.
    """
    package = Path(__file__).resolve().parent
    for folder in (package / "cmake", package.parent / "examples" / "firmware" / "cmake"):
        if (folder / "Qlinkgen.cmake").is_file():
            return folder
    raise FileNotFoundError(f"no Qlinkgen.cmake in {package} or next to it; reinstall qlinkgen")
