# `make demo` and `make test` need a Python 3.11 to 3.13 and nothing else; they make $(VENV) themselves.
PYTHON ?= python3
VENV ?= .venv
OUT ?= demo
# Where there is no GPU: TORCH_INDEX=URL of the CPU package index that PyTorch's installation page names saves gigabytes.
TORCH_INDEX ?=
# Beside a sourced ROS 2 Jazzy: make test EXTRAS=dev leaves the rclpy wheels out.
EXTRAS ?= ros,dev

BIN = $(VENV)/bin
# Byte code is written by what is imported first: without it every process compiles torch and all else anew.
export PYTHONDONTWRITEBYTECODE :=
STAMP = $(VENV)/.installed
INDEX = $(if $(TORCH_INDEX),--extra-index-url $(TORCH_INDEX))

# What pip says of every package that a second, local index does not have; whatever else it says is shown.
HARMLESS = ^WARNING: Location .* is ignored: it is neither a file nor a directory
# Of all that pip tells, what takes long: packages of a megabyte and more, and the end.
SHOWN = s/^ *(Downloading|Using cached) (.*\/)?([A-Za-z0-9_.]+)-[0-9].* \(([0-9.]+ [MG]B)\).*/  \3, \4/p
UNPACKED = s/^Installing collected packages:.*/  now unpacking them all, which takes a while without a sign/p
.PHONY: demo test test-long test-hours coverage lint bench dist docs schemas clean setup

$(STAMP): pyproject.toml exam/pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' || \
	  { echo "deeptruck needs Python 3.11, 3.12 or 3.13: make $(MAKECMDGOALS) PYTHON=python3.12"; exit 2; }
	@echo "setting up $(VENV), some minutes the first time; large packages as they come:"
	@$(PYTHON) -m venv $(VENV)
	@bash -o pipefail -c '$(BIN)/pip install --no-compile --disable-pip-version-check --progress-bar off $(INDEX) \
	  -c constraints.txt -e ".[$(EXTRAS)]" -e exam 2> >(grep -v "$(HARMLESS)" >&2) | sed -unE "$(SHOWN);$(UNPACKED)"'
	@touch $@

setup: $(STAMP)

demo: setup
	@$(BIN)/python demo.py --out $(OUT)

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

test: setup
	$(BIN)/python -m pytest --durations=10

# What `make test` leaves out: kills, mutants, trainings to the end, every truck where one stands for all.
test-long: setup
	$(BIN)/python -m pytest -m "long and not hours" --durations=10

# What neither has the time for: a thousand damaged files for every reader, eleven hours of the whole chain.
test-hours: setup
	$(BIN)/python -m pytest -m hours

# Lines of the packages that `make test` runs, and build/coverage/index.html. Compiled loops and processes that tests
# start are not counted.
coverage: setup
	$(BIN)/python -m pytest --cov=src --cov=exam/src --cov=benchmarks --cov-report=term --cov-report=html:build/coverage

bench: setup
	for b in benchmarks/bench_*.py; do $(BIN)/python $$b || exit 1; done

# Wheels and sdists in build/dist, each wheel made from its sdist, which must therefore be whole.
dist: setup
	rm -rf build/dist
	$(BIN)/python -m build --no-isolation --outdir build/dist
	$(BIN)/python -m build --no-isolation --outdir build/dist exam
	$(BIN)/python -m twine check --strict build/dist/*

# What documents have from the source: the JSON Schemas, by which editors check files, and tables of pages.
schemas: setup
	$(BIN)/python docs/schemas/generate.py
	$(BIN)/python docs/tables.py

# The documentation as a site, warnings as errors: build/docs/index.html. Before, the picture of a report of this version.
docs: $(VENV)/.docs
	$(BIN)/python docs/report_picture.py
	$(BIN)/python -m sphinx -q -W --keep-going -b html docs build/docs

$(VENV)/.docs: $(STAMP)
	@bash -c '$(BIN)/pip install -q --no-compile --disable-pip-version-check $(INDEX) -c constraints.txt -e ".[docs]" \
	  2> >(grep -v "$(HARMLESS)" >&2)'
	@touch $@

clean:
	rm -rf $(VENV) demo runs build .mypy_cache .ruff_cache .pytest_cache .hypothesis
