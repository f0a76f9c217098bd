# What a person types at this project. Needs Python 3.11 or later, make and git; gcc for the C side.
# Tests that want more (clang, cross compilers) are skipped with the name of the Debian package to install.

PYTHON ?= python3
BIN := .venv/bin
PIP := $(BIN)/python -m pip install -qq --disable-pip-version-check --editable
# A peer of the library's tests; it asks for an older construct, and works with this one.
CRSF := crsf-parser==0.3.2
# Scripts are checked like the package; a folder without any would be an error to mypy.
TYPED := qlinkgen tests $(sort $(dir $(wildcard examples/*.py benchmarks/*.py)))

# Half of what a start of Python takes is compiling, and the tests start it some hundred times.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-fast lint generate bench soak soak-schemas soak-frames mutants clean

help:  ## Show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "  make %-12s %s\n", $$1, $$2}' $(firstword $(MAKEFILE_LIST))

setup: .venv/.dev  ## Make .venv with qlinkgen (editable) and the developers' tools

# What a user has: enough for the demo, and quicker to get than the tools.
.venv/.user: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "qlinkgen needs Python 3.11 or later; say which: make PYTHON=python3.12"; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null \
	  || { echo "$(PYTHON) cannot make virtual environments; on Debian: apt-get install python3-venv"; exit 1; }
	@echo "== setting up .venv"
	@$(PYTHON) -m venv .venv
	@$(PIP) '.[load]'
	@touch $@

.venv/.dev: .venv/.user
	@echo "== adding linters, type checkers and test tools (a minute, once)"
	@$(PIP) '.[dev,library-tests]'
	@$(BIN)/python -m pip install -qq --disable-pip-version-check --no-deps $(CRSF)
	@touch $@

demo: .venv/.user  ## A message of each protocol in construct, Python and C; a bus, a ring and a chip set; statistics
	@mkdir -p build
	@$(BIN)/python examples/demo.py
	@$(BIN)/python examples/bus.py build/demo.pcapng
	@$(BIN)/python examples/ring.py
	@$(BIN)/python examples/chip.py
	@echo "statistics of the recorded bus:"
	@$(BIN)/qlinkgen stats qlink build/demo.pcapng
	@$(BIN)/qlinkgen stats qlink build/demo.pcapng --format html -o build/demo.html

test: lint  ## Lint, types, layers, drift of the generated files, then every test
	@echo "== pytest"
	@$(BIN)/python -m pytest -n auto --dist worksteal

test-fast: setup  ## A minute of tests: no pseudo-terminal, no other program such as a compiler, nothing slow
	@HYPOTHESIS_PROFILE=fast $(BIN)/python -m pytest -n auto --dist worksteal -m "not pty and not program and not slow"

lint: setup  ## Everything of `test` that runs no test
	@echo "== ruff"
	@$(BIN)/ruff check --quiet
	@$(BIN)/ruff format --check --quiet
	@echo "== mypy"
	@$(BIN)/mypy $(TYPED)
	@echo "== import-linter"
	@$(BIN)/lint-imports --no-logo
	@echo "== qlinkgen generate --check"
	@$(BIN)/qlinkgen generate --check
	@echo "== prose"
	@$(BIN)/python -m tests.prose

generate: .venv/.user  ## Rewrite generated/ from schemas/
	@$(BIN)/qlinkgen generate

bench: .venv/.user  ## Measure the generated code beside its peers
	@$(PIP) '.[bench,library-tests]'
	@$(BIN)/python -m pip install -qq --disable-pip-version-check --no-deps $(CRSF)
	@$(BIN)/python benchmarks/run.py

soak: .venv/.user  ## A million transactions on a bad line, 50 000 over a pty, 20 000 with each firmware, 500 000 of other protocols, and the behaviours of every bus over a pty; writes docs/soak.md (45 minutes)
	@$(BIN)/python -m tests.soak.bus --output docs/soak.md
	@$(BIN)/python -m tests.soak.firmware --output docs/soak.md
	@$(BIN)/python -m tests.soak.buses --output docs/soak.md
	@QLINKGEN_PTYS=all $(BIN)/python -m pytest tests/bus -k behaviour -m pty

soak-schemas: .venv/.dev  ## 1 000 random whole schemas through every target, gcc and clang; writes docs/soak-schemas.md (40 minutes)
	@$(BIN)/python -m tests.whole --seeds 1..1000 --every --report build/soak-schemas.txt --output docs/soak-schemas.md
	@$(BIN)/python -m tests.whole --seeds 10001..11500 --pairs --every --report build/soak-pairs.txt

soak-frames: .venv/.dev  ## A million mutated frames of each protocol through Python, C and interpreter; writes docs/soak-frames.md (20 minutes)
	@$(BIN)/python -m tests.soak.frames --output docs/soak-frames.md

mutants: .venv/.dev  ## 500 mutants of plan/ and model/ against the tests; writes docs/mutants.md (an hour)
	@$(PIP) '.[mutants]'
	@$(BIN)/python -m tests.mutants --output docs/mutants.md

clean:  ## Remove everything that make and the tools made
	rm -rf .venv build dist .hypothesis .mypy_cache .pytest_cache .ruff_cache .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
