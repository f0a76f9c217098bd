"""Check the prose of changed files; exit code 1 if there is something to reword."""

from __future__ import annotations

import sys

from tests.prose import UNTOUCHED, digest, hits, texts, untouched


def main(arguments: list[str]) -> int:
    """`--forget` removes exempt files that changed or need no rewording any more."""
    before, found = untouched(), []
    left = set()
    for path, text in texts():
        here = hits(path, text)
        if here and (line := digest(path, text)) in before:
            left.add(line)
        else:
            found += here
    if arguments == ["--forget"]:
        UNTOUCHED.write_text(
            "".join(f"{line}\n" for line in sorted(left, key=lambda line: line.split()[1])), "utf-8"
        )
    elif gone := before - left:
        print(
            f"{len(gone)} files of {UNTOUCHED.name} changed: reword them, then python -m tests.prose --forget"
        )
        return 1
    for each in found:
        print(each)
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
