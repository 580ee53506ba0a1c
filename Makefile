# Everything from a fresh machine with Python >= 3.11 and make: `make run`, `make test`.
# Another interpreter: make PYTHON=/path/to/python run

VENV := .venv
PEERS := .venv-peers
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
PYTHON ?= python3 python3.14 python3.13 python3.12 python3.11 python
FITS := import sys; assert sys.version_info >= (3, 11)
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help install run gallery test bench bench-full peers lint clean

help:  ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "make %-10s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

install: $(STAMP)  ## .venv with the pinned versions and the project, and the machine code of the engines
	$(BIN)/fpk-rocking warmup

run: $(STAMP)  ## Fig. 6 by both engines, into results/fig06
	@echo "Fig. 6 by both engines (the first time their machine code is compiled on the way)"
	$(BIN)/python cases/fig06_jpdf_evolution.py --out results/fig06

gallery: $(STAMP)  ## every figure, into docs/gallery, about half an hour
	$(BIN)/python cases/gallery.py

test: $(STAMP)  ## the test suite
	$(BIN)/python -m pytest

bench: $(STAMP)  ## the benchmarks that write docs/benchmarks.md, about 15 minutes
	@set -e; for script in cold_start density monte_carlo white_order equal_error; do echo "== $$script"; $(BIN)/python benchmarks/$$script.py; done
	$(BIN)/python benchmarks/practical_blocks.py --scenes 3 --paths 40000

bench-full: bench  ## the slow tests, and the benchmarks that take longer
	$(BIN)/python -m pytest -m slow
	@set -e; for script in fine_reference.py eulerian.py estimates.py hard_cases.py practical_blocks.py "eulerian.py --all"; do echo "== $$script"; $(BIN)/python benchmarks/$$script; done

peers: $(PEERS)/.installed  ## other packages on problems they can state, into docs/peers.md, about ten minutes
	$(PEERS)/bin/python benchmarks/peers.py

lint: $(STAMP)  ## ruff
	$(BIN)/ruff check

clean:  ## remove environments, caches and results
	rm -rf $(VENV) $(PEERS) build dist results .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# The build backend is installed first, pinned like the rest, and used from there: an isolated build would fetch another.
$(STAMP): constraints.txt pyproject.toml
	@echo "Looking for Python >= 3.11"; \
	$(BIN)/python -c '$(FITS); import pip' 2>/dev/null && exit 0; \
	for python in $(PYTHON); do \
	    if "$$python" -c '$(FITS)' 2>/dev/null; then exec "$$python" -m venv --clear $(VENV); fi; \
	done; \
	echo "No Python >= 3.11 among: $(PYTHON). Install one, or name it: make PYTHON=/path/to/python $(MAKECMDGOALS)" >&2; exit 1
	@echo "Installing the pinned versions into $(VENV), about half a minute"
	$(INSTALL) hatchling
	$(INSTALL) --no-build-isolation -e '.[cluster,dev,frames,test,view]'
	@touch $@

$(PEERS)/.installed: $(STAMP) constraints-peers.txt
	$(BIN)/python -m venv --clear $(PEERS)
	$(subst $(VENV),$(PEERS),$(INSTALL)) hatchling
	$(subst $(VENV),$(PEERS),$(INSTALL)) -c constraints-peers.txt --no-build-isolation -e '.[peers]'
	@touch $@
