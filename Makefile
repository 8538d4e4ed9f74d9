# Every target sets up what it needs: a virtual environment from the locked, hashed requirements.
# Needs python3 (3.11 or later), pip and make.

PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/ready

# Small matrices get slower with several BLAS threads, and results must not depend on their number.
export OPENBLAS_NUM_THREADS := 1
export OMP_NUM_THREADS := 1

.PHONY: demo test check bench results lock clean

demo: $(READY)  ## A whole autonomous session on the simulated rig, evaluated, with its report
	$(BIN)/tactile-lab run --rig sim --object box-10x6x4 --grasps 16 --seed 1 --out runs

test: check  ## Linters, types, layers, then all tests
	$(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder

check: $(READY)  ## Linters, types and the layer contract
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(READY)  ## Speed and memory, printed beside the reference
	$(BIN)/tactile-lab bench

METHODS := methods-2d contour-limit methods-3d known-shape solid-limit methods-6dof random-contacts graph-stress
FIGURES := figure-2.7 figure-2.12 figure-3.12 figure-3.14 figure-3.15 figure-3.16

results: $(READY)  ## Methods and the thesis's figures over the reported seeds (hours), with tables and plots, into docs
	for name in $(METHODS); do $(BIN)/tactile-lab experiment $$name --into docs/results.md || exit 1; done
	for name in $(FIGURES); do $(BIN)/tactile-lab experiment $$name --into docs/thesis-figures.md || exit 1; done

lock:  ## Resolve the dependencies again, with hashes
	$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-config \
		--no-emit-index-url --no-header --no-annotate --extra dev -o requirements.lock pyproject.toml

clean:
	rm -rf $(VENV) build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .import_linter_cache .hypothesis

# pip of the system installs into the environment, so that a Python without ensurepip will do.
$(READY): requirements.lock pyproject.toml
	$(PYTHON) -m venv --without-pip $(VENV)
	$(PYTHON) -m pip --python $(BIN)/python install --quiet --disable-pip-version-check --require-hashes --no-deps -r requirements.lock
	$(PYTHON) -m pip --python $(BIN)/python install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $(READY)
