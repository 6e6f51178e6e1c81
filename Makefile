# make            run every notebook, build the book under build/site/, print the ledger's summary
# make test       lint, types, floors, tests, notebooks under strict nbval, wheel, browser
# make notebooks  re-execute the notebooks; show what would change; store it with ACCEPT=1
# make counts     record how many tests each file holds, after adding or removing some
# make lab        open JupyterLab
# make bench      ratios against peers, measured side by side
# make lock       resolve requirements.lock anew
# make clean      remove everything that make made, but for .venv and .tools

UV_VERSION := 0.9.30
UV  := $(or $(shell command -v uv 2>/dev/null),.tools/bin/uv)
BIN := .venv/bin
PY  := $(BIN)/python

export OMP_NUM_THREADS := 1
export PYTHONDONTWRITEBYTECODE := 1
# A wheel comes from the configured index; no Python interpreter is ever downloaded.
export UV_PYTHON_DOWNLOADS := never
unexport MPLBACKEND VIRTUAL_ENV

.DEFAULT_GOAL := all
.PHONY: all setup notebooks site test lint unit browser counts lab bench lock clean

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
	@touch $@
