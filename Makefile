# make            run every notebook, build the book under build/site/, print the ledger's summary
# make test       lint, types, layers, tests, notebooks under strict nbval, wheel, browser
# make notebooks  execute the notebooks and show what would change; ACCEPT=1 stores it
# make lessons    derive the editions of the lessons whose source changed, and their slides
# make nbval      test the notebooks that your changes affect, or NB=path, under strict nbval
# make renew      update checksums, counts of claims and the README after a change of data
# make dist       build the wheel and the source distribution under dist/
# make coverage   show which lines the unit tests do not run
# make handout    write build/handout.zip for students, without solutions
# make wheels     fill build/wheels for a classroom without a network; SYSTEM=windows PYTHON=3.12
# make lab        open JupyterLab
# make app        serve the interactive tools of notebooks/explore/ as web pages, with an index
# make bench      compare speed with other programs; plot how main jobs scale: build/growth.html
# make fuzz       feed large and hostile bytes to every reader and decoder (half an hour)
# make mutants    make small changes to the code; a test or the ledger must detect them (an hour)
# make clients    test how third-party Modbus clients handle faults on the wire (five minutes)
# make lock       regenerate requirements.lock
# make clean      remove everything that make created, except .venv and .tools

UV_VERSION := 0.9.30
UV  := $(or $(shell command -v uv 2>/dev/null),.tools/bin/uv)
BIN := .venv/bin
PY  := $(BIN)/python

export OMP_NUM_THREADS := 1
# This environment has its own font list; a stale list of another would cause warnings in notebooks.
export MPLCONFIGDIR := $(CURDIR)/.venv/matplotlib
# No Python interpreter is ever downloaded.
export UV_PYTHON_DOWNLOADS := never
# Compiled modules are kept in the environment, even if the caller disables them: otherwise each
# notebook and each program that a test starts would compile pandas and matplotlib again.
export PYTHONPYCACHEPREFIX := $(CURDIR)/.venv/pycache
unexport PYTHONDONTWRITEBYTECODE
# If a backend is set, no figure reaches a notebook.
unexport MPLBACKEND
unexport VIRTUAL_ENV

.DEFAULT_GOAL := all
.NOTPARALLEL:
.PHONY: all setup site notebooks nbval renew test lint unit browser coverage dist lessons handout wheels lab app bench fuzz mutants clients lock clean

all: site
	@$(PY) -m shipnet ledger --summary

setup: .venv/installed

.tools/bin/uv:
	@python3 -m pip install --quiet --disable-pip-version-check --root-user-action=ignore \
	  --target .tools uv==$(UV_VERSION) \
	|| { echo "shipnet needs Python 3.11 or newer with pip (or uv on the PATH): install python3-pip"; exit 1; }

.venv/installed: requirements.lock pyproject.toml $(filter .tools/%,$(UV))
	@echo "setting up .venv"
	@$(UV) venv --quiet --allow-existing --python '>=3.11' .venv
	@$(UV) pip sync --quiet --python $(PY) --require-hashes requirements.lock
	@$(UV) pip install --quiet --python $(PY) --no-deps --no-build-isolation --editable .
	@$(PY) -c "import matplotlib.font_manager" 2>/dev/null
	@touch $@

site: setup
	@$(PY) docs/build.py $(STORED)

notebooks: setup
	@$(PY) docs/notebooks.py store $(if $(filter 1,$(ACCEPT)),--accept)

# Lint and book run beside the unit tests, and their output follows at the end. The unit tests execute
# the notebooks and compare the stored outputs, so the book does not execute them again.
test: setup
	@mkdir -p build
	@$(MAKE) --no-print-directory lint site STORED=--stored > build/test.log 2>&1 & others=$$!; \
	trap "kill $$others" INT; $(MAKE) --no-print-directory unit; unit=$$?; \
	wait $$others; others=$$?; cat build/test.log; exit $$((unit || others))
	@$(MAKE) --no-print-directory browser
	@echo "all tests passed"

# Garbage collection takes two fifths of the time of mypy and frees almost nothing.
MYPY := $(PY) -c "import gc; gc.enable = gc.disable; from mypy.__main__ import console_entry as check; check()"

lint: setup
	@echo "lint, spelling, types, layers"
	@$(BIN)/ruff check --quiet
	@$(BIN)/typos
	@$(BIN)/ruff format --check --quiet || { $(BIN)/ruff format --diff --quiet; exit 1; }
	@$(MYPY) --no-error-summary
	@$(BIN)/lint-imports --no-logo

# The browser tests run last and alone, because a busy machine makes a browser slow. Two run at a
# time, because they mostly wait for a kernel to start.
NBVAL := --nbval --nbval-current-env --nbval-sanitize-with=tests/nbval_sanitize.cfg \
         --nbval-cell-timeout=60
UNIT  := $(BIN)/pytest -q -n logical --dist loadscope --doctest-modules $(NBVAL) \
         --ignore=tests/browser tests shipnet notebooks
WEB   := $(BIN)/pytest -q -n 2 --dist load tests/browser

# How long a cell takes must not decide whether its output has a progress bar.
unit nbval: export TQDM_DISABLE := 1

unit: setup
	@echo "unit, property and doc tests, notebooks under strict nbval, wheel"
	@$(UNIT)

# By default, the notebooks affected by the differences from the last commit.
NB = $(shell $(PY) docs/notebooks.py affected $$(git diff --name-only HEAD))

nbval: setup
	@for notebook in $(or $(NB),none); do \
	  [ $$notebook != none ] || { echo "no change since the last commit affects a notebook"; exit 0; }; \
	  $(BIN)/pytest -q $(NBVAL) $$notebook || exit 1; done

renew: setup
	@$(PY) docs/renew.py

browser: setup
	@echo "the book in a browser"
	@$(WEB)

coverage: setup
	@SHIPNET_COMPILED=0 $(BIN)/pytest -q -n logical --dist loadscope --doctest-modules --cov --cov-report=term \
	  --ignore=tests/browser tests shipnet

dist: setup
	@rm -rf dist
	@$(PY) -m hatchling build -d dist
	@ls dist

lessons: setup
	@$(PY) docs/editions.py derive
	@$(PY) docs/editions.py slides

handout: setup
	@$(PY) docs/editions.py handout

wheels: setup
	@$(PY) docs/wheels.py $(UV) $(SYSTEM) $(PYTHON)

lab: setup
	@$(BIN)/jupyter lab --notebook-dir=notebooks

app: setup
	@$(PY) docs/app.py

bench: setup
	@for program in benchmarks/[a-z]*.py; do $(PY) $$program || exit 1; done

fuzz: setup
	@$(UV) pip install --quiet --python $(PY) --group fuzz
	@$(PY) tests/fuzz/run.py

mutants: setup
	@$(UV) pip install --quiet --python $(PY) --group mutants
	@SHIPNET_COMPILED=0 $(PY) tests/mutants/run.py --left
	@$(PY) tests/mutants/ledger.py && $(PY) tests/mutants/ledger.py --draw 40

clients: setup
	@$(PY) benchmarks/modbus_clients/run.py $(UV)

lock: $(filter .tools/%,$(UV))
	@$(UV) pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header \
	  --upgrade --all-extras --group test --group docs --group bench --group build \
	  --output-file requirements.lock pyproject.toml

clean:
	rm -rf build dist .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis
