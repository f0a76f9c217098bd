"""Soaks: long random sessions against plain models, each a program such as `python -m tests.soak.bus`."""
