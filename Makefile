# Everything from a fresh machine with Python >= 3.11 and make: `make run`, `make test`.
# Another interpreter: make PYTHON=/path/to/python run

VENV := .venv
PEERS := .venv-peers
INTEROP := .venv-interop
ENGINES := .venv-engines
FLOORS := .venv-floors
NEWEST := .venv-newest
BIN := $(VENV)/bin
CORE := $(VENV)/.installed
STAMP := $(VENV)/.installed-all
PYTHON ?= python3 python3.14 python3.13 python3.12 python3.11 python
FITS := import sys; assert sys.version_info >= (3, 11)
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help install run gallery test floors newest slow mutants docs wheel bench bench-full peers interop engines lint clean

help:  ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "make %-10s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

install: $(CORE)  ## .venv with the pinned versions and the project, and the machine code of the engines
	$(BIN)/fpk-rocking warmup

run: $(CORE)  ## Fig. 6 by both engines, into results/fig06
	@echo "Fig. 6 by both engines (the first time their machine code is compiled on the way)"
	$(BIN)/python cases/fig06_jpdf_evolution.py --out results/fig06

gallery: $(STAMP)  ## every figure, into docs/gallery, about half an hour
	$(BIN)/python cases/gallery.py

test: $(STAMP)  ## the test suite, without the slow tests
	$(BIN)/python -m pytest -n auto --dist worksteal

TESTS := tests
floors: $(FLOORS)/.installed  ## the test suite with the lowest versions that pyproject.toml allows (TESTS=tests/physics)
	NUMBA_CACHE_DIR=$(FLOORS)/cache $(FLOORS)/bin/python -m pytest -n auto --dist worksteal $(TESTS)

newest: $(NEWEST)/.installed  ## the test suite with the newest versions, nothing pinned (TESTS=tests/physics)
	NUMBA_CACHE_DIR=$(NEWEST)/cache $(NEWEST)/bin/python -m pytest -n auto --dist worksteal $(TESTS)

slow: $(STAMP)  ## the slow tests: large samples, fine meshes, figures as they are published
	$(BIN)/python -m pytest -n auto --dist worksteal -m slow

COUNT := 20
SEED := 1
mutants: $(STAMP)  ## one-line mistakes drawn at random (COUNT=20 SEED=1), and whether the tests notice them
	$(BIN)/python tests/mutants --count $(COUNT) --seed $(SEED)

docs: $(STAMP)  ## the site, into build/docs, and the code of pages and docstrings; a warning is an error
	$(BIN)/sphinx-build -q -W --keep-going -d build/doctrees docs build/docs
	$(BIN)/python -m pytest -q -n auto --dist worksteal -m site tests/project
	@echo "Open build/docs/index.html"

wheel: $(STAMP)  ## source distribution and its wheel, into dist, and a run of the wheel in a clean environment
	rm -rf dist build/sdist build/clean
	$(BIN)/python -m hatchling build -t sdist -d dist
	mkdir -p build/sdist && tar -xzf dist/*.tar.gz -C build/sdist --strip-components 1
	cd build/sdist && ../../$(BIN)/python -m hatchling build -t wheel -d ../../dist
	$(BIN)/python -m venv build/clean
	$(subst $(VENV),build/clean,$(INSTALL)) dist/*.whl
	cd build/clean && env -u PYTHONPATH bin/fpk-rocking compare main --cycles 2 --realizations 5000 --tol 1e-2 --out out

bench: $(STAMP)  ## the benchmarks that write docs/benchmarks.md, about 15 minutes
	@set -e; for script in cold_start density monte_carlo band_survival white_order equal_error; do echo "== $$script"; $(BIN)/python benchmarks/$$script.py; done
	$(BIN)/python benchmarks/practical_blocks.py --scenes 3 --paths 40000

bench-full: bench slow  ## the slow tests, and the benchmarks that take longer
	@set -e; for script in fine_reference.py eulerian.py estimates.py hard_cases.py practical_blocks.py "eulerian.py --all"; do echo "== $$script"; $(BIN)/python benchmarks/$$script; done

peers: $(PEERS)/.installed  ## other packages on problems they can state, into docs/validation.md, about ten minutes
	$(PEERS)/bin/python benchmarks/peers.py

interop: $(INTEROP)/.installed  ## annual rates of exported curves by the calculations of OpenQuake and pelicun
	$(INTEROP)/bin/python benchmarks/interop.py

engines: $(ENGINES)/.installed  ## physics engines on the rocking block, three minutes (docs/engines.md)
	$(ENGINES)/bin/python benchmarks/peers_engines.py

lint: $(STAMP)  ## ruff: rules and format; mypy: types
	$(BIN)/ruff check
	$(BIN)/ruff format --check --quiet
	$(BIN)/mypy

clean:  ## remove environments, caches and results
	rm -rf $(VENV) $(PEERS) $(INTEROP) $(ENGINES) $(FLOORS) $(NEWEST) build dist results .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# The build backend is installed first, pinned like the rest, and used from there: an isolated build would fetch another.
$(CORE): constraints.txt pyproject.toml
	@echo "Looking for Python >= 3.11"; \
	$(BIN)/python -c '$(FITS); import pip' 2>/dev/null && exit 0; \
	for python in $(PYTHON); do \
	    if "$$python" -c '$(FITS)' 2>/dev/null; then exec "$$python" -m venv --clear $(VENV); fi; \
	done; \
	echo "No Python >= 3.11 among: $(PYTHON). Install one, or name it: make PYTHON=/path/to/python $(MAKECMDGOALS)" >&2; exit 1
	@echo "Installing the pinned versions into $(VENV)"
	$(INSTALL) hatchling
	$(INSTALL) --no-build-isolation -e .
	@touch $@

$(STAMP): $(CORE)
	@echo "Installing what tests, pages and pictures in 3-D need, about half a minute"
	$(INSTALL) --no-build-isolation -e '.[cluster,dev,docs,frames,test,view]'
	@touch $@

$(PEERS)/.installed: $(STAMP) constraints-peers.txt
	$(BIN)/python -m venv --clear $(PEERS)
	$(subst $(VENV),$(PEERS),$(INSTALL)) hatchling
	$(subst $(VENV),$(PEERS),$(INSTALL)) -c constraints-peers.txt --no-build-isolation -e '.[peers]'
	@touch $@

$(ENGINES)/.installed: $(STAMP) constraints-engines.txt
	$(BIN)/python -m venv --clear $(ENGINES)
	$(subst $(VENV),$(ENGINES),$(INSTALL)) hatchling
	$(subst $(VENV),$(ENGINES),$(INSTALL)) -c constraints-engines.txt --no-build-isolation -e '.[engines]'
	@touch $@

# OpenQuake's own dependencies contain GDAL, which neither its readers nor a calculation from a hazard curve need.
$(INTEROP)/.installed: $(STAMP) constraints-interop.txt
	$(BIN)/python -m venv --clear $(INTEROP)
	$(INTEROP)/bin/python -m pip install --quiet --disable-pip-version-check -c constraints-interop.txt hatchling
	$(INTEROP)/bin/python -m pip install --quiet --disable-pip-version-check -c constraints-interop.txt --no-deps openquake.engine
	$(INTEROP)/bin/python -m pip install --quiet --disable-pip-version-check -c constraints-interop.txt --no-build-isolation -e '.[interop]'
	@touch $@

# The lowest versions have wheels for no newer Python than 3.12.
FLOOR_PYTHON ?= python3.12 python3.11 python3
$(FLOORS)/.installed: pyproject.toml
	@for python in $(FLOOR_PYTHON); do \
	    if "$$python" -c 'import sys; assert (3, 11) <= sys.version_info < (3, 13)' 2>/dev/null; then \
	        exec "$$python" -m venv --clear $(FLOORS); \
	    fi; \
	done; \
	echo "No Python 3.11 or 3.12 among: $(FLOOR_PYTHON). Name one: make FLOOR_PYTHON=/path/to/python floors" >&2; exit 1
	@$(FLOORS)/bin/python -c 'import pathlib, re, tomllib; \
	project = tomllib.loads(pathlib.Path("pyproject.toml").read_text())["project"]; \
	more = project["optional-dependencies"]; \
	asked = [*project["dependencies"], *more["frames"], *more["view"], *more["cluster"], *more["test"]]; \
	print(*dict.fromkeys(re.sub(">=(.*)", r"==\1.*", one) for one in asked if not one.startswith("mypy")), sep="\n")' \
	    > $(FLOORS)/lowest.txt
	$(FLOORS)/bin/python -m pip install --quiet --disable-pip-version-check hatchling -r $(FLOORS)/lowest.txt
	$(FLOORS)/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $@

$(NEWEST)/.installed: pyproject.toml
	@for python in $(PYTHON); do \
	    if "$$python" -c '$(FITS)' 2>/dev/null; then exec "$$python" -m venv --clear $(NEWEST); fi; \
	done; exit 1
	$(NEWEST)/bin/python -m pip install --quiet --disable-pip-version-check hatchling
	$(NEWEST)/bin/python -m pip install --quiet --disable-pip-version-check --upgrade --no-build-isolation \
	    -e '.[cluster,frames,test,view]'
	@touch $@
