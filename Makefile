# Every target sets up what it needs: a virtual environment from the locked, hashed requirements.
# Needs python3 (3.11 or later), pip and make.

PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/ready

# Small matrices get slower with several BLAS threads, and results must not depend on their number.
export OPENBLAS_NUM_THREADS := 1
export OMP_NUM_THREADS := 1

# Tests start the program a hundred times, and three workers read every test: what is compiled is kept, even where the
# surroundings say otherwise.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: help demo test suite test-long check bench results experiments coverage docs lock clean mutants

help:  ## This list
	@echo "make TARGET:"
	@sed -n 's/^\([a-z]*\):.*  ## /  \1\t/p' $(MAKEFILE_LIST) | expand -t 16

demo: $(READY)  ## A whole autonomous session on the simulated rig, evaluated, with its report
	$(BIN)/tactile-lab run --rig sim --object box-10x6x4 --grasps 16 --seed 1 --out runs

# The linters take one core for a minute: the tests take the others meanwhile.
test: $(READY)  ## Linters, types, layers, and all tests but the long ones, side by side
	$(MAKE) --no-print-directory --jobs=2 check suite

suite: $(READY)  ## All tests but the long ones
	$(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder

test-long: $(READY)  ## The long tests that make test leaves out: whole sessions in real time, studies over seeds
	$(BIN)/python -m pytest -n auto --dist loadfile -m long

check: $(READY)  ## Linters, types and the layer contract
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(READY)  ## Speed and memory, printed beside the reference
	$(BIN)/tactile-lab bench

results: $(READY)  ## Pages and plots in docs from the stored results (seconds)
	$(BIN)/tactile-lab experiment pages

MUTATIONS ?= 204
SEED      ?= 1
PROCESSES ?= 1

mutants: .coverage  ## Random single mutations of the packages: which of them do the tests of their lines notice? (an hour or two)
	$(BIN)/python -m tests.mutants --count $(MUTATIONS) --seed $(SEED) --processes $(PROCESSES) --coverage .coverage --out build/mutants.json

# Which test runs which line. `make coverage` makes it anew.
.coverage:
	$(MAKE) --no-print-directory coverage

experiments: $(READY)  ## The stored experiments again, by their commands, stored with their pages (days; goes on where it stopped)
	$(BIN)/tactile-lab experiment commands | while read -r command; do eval "$(BIN)/$$command --store" </dev/null || exit 1; done

coverage: $(READY)  ## All tests, and how much of each package they run through, as a stored result
	$(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder -m "" --cov --cov-context=test --cov-report=json
	$(BIN)/python -m tests.support.package_coverage coverage.json --store

DOCS := build/docs-venv

docs: $(DOCS)/ready  ## The documentation as a site with search, in build/site; strict: a link that leads nowhere fails
	NO_MKDOCS_2_WARNING=1 $(DOCS)/bin/mkdocs build --quiet --strict
	@echo "python3 -m http.server --bind 127.0.0.1 --directory build/site   shows it, search included, without a network"

# The site's generator reads the packages' text only: it has an environment of its own.
$(DOCS)/ready: docs/requirements.lock
	$(PYTHON) -m venv --without-pip $(DOCS)
	$(PYTHON) -m pip --python $(DOCS)/bin/python install --quiet --disable-pip-version-check --require-hashes --no-deps -r docs/requirements.lock
	touch $@

lock:  ## Resolve the dependencies again, with hashes
	$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-config \
		--no-emit-index-url --no-header --no-annotate --extra dev --override .ci/overrides.txt -o requirements.lock pyproject.toml
	$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-config \
		--no-emit-index-url --no-header --no-annotate --group docs -o docs/requirements.lock

clean:  ## Remove the environment, what was built, and caches
	rm -rf $(VENV) build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .import_linter_cache .hypothesis

# pip of the system installs into the environment, so that a Python without ensurepip will do. It would compile what it
# installs on one core only. A file that does not compile, which nobody imports, does no harm.
$(READY): requirements.lock pyproject.toml
	$(PYTHON) -m venv --without-pip $(VENV)
	$(PYTHON) -m pip --python $(BIN)/python install --quiet --disable-pip-version-check --no-compile --require-hashes --no-deps -r requirements.lock
	$(BIN)/python -W ignore -m compileall -qq -j 0 $(VENV)/lib || true
	$(PYTHON) -m pip --python $(BIN)/python install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $(READY)
