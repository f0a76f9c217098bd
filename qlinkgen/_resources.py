"""Where the files shipped beside the code are found."""

from __future__ import annotations

from pathlib import Path

__all__ = ["schemas_dir"]


def schemas_dir() -> Path:
    """Return the folder of the shipped protocol descriptions.

    In a repository, and so in an editable install, that is the top-level folder `schemas`: a description
    edited there takes effect at once. A wheel carries a copy of the folder inside the package.

    Raises:
        FileNotFoundError: the installation is incomplete and has neither.
    """
    package = Path(__file__).resolve().parent
    # The copy first: next to an installed package, `../schemas` would be somebody else's folder.
    for folder in (package / "schemas", package.parent / "schemas"):
        if folder.is_dir():
            return folder
    raise FileNotFoundError(f"no schemas folder in {package} nor beside it; reinstall qlinkgen")
