"""``python -m qlinkgen`` is the command ``qlinkgen``."""

from qlinkgen.cli import main

if __name__ == "__main__":
    main()
