# SPDX-License-Identifier: Apache-2.0
# make demo, make test: each works alone on a fresh machine and installs what it needs into .venv.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/installed

# all traffic of demo and tests stays on this machine
export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
# what was imported once is compiled: without it each of hundreds of processes does it again
export PYTHONDONTWRITEBYTECODE :=

.PHONY: help env warm demo test lint types tests coverage docs peers lock clean

help:
	@echo 'make demo   simulated ship -> ROS topics -> node -> bag -> replay -> report'
	@echo 'make test   lint, types, tests'
	@echo 'make coverage  the same tests, and which branches they take (twice as long)'
	@echo 'make docs   the pages of docs/ as a site, in site'
	@echo 'make env    only the environment, in $(VENV)'
	@echo 'make warm   compile now what a first start would compile (a minute)'
	@echo 'make peers  what benchmarks compare with, into the same environment'
	@echo 'make lock   resolve the dependencies again into requirements.lock (needs uv)'

env: $(STAMP)

$(STAMP): requirements.lock setup.py setup.cfg pyproject.toml
	@$(PYTHON) -c 'import sys; v = sys.version_info; sys.exit(0 if (3, 11) <= v < (3, 14) else \
	    f"ERROR: {sys.executable} is Python {v.major}.{v.minor}; 3.11 to 3.13 is needed: make PYTHON=python3.12 ...")'
	$(PYTHON) -m venv $(VENV)
	@# Python compiles what is imported; pip would compile all of it, which is 40 % of the CPU
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $@

demo: env
	$(BIN)/shipdrag demo --out demo

warm: env
	$(BIN)/python deploy/warm.py

test: env
	@$(MAKE) --jobs=3 lint types warm  # else each worker of the tests compiles for itself
	@$(MAKE) tests

lint: env
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: env
	$(BIN)/mypy

tests: env
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 3 --dist worksteal  # of three on two cores, one waits for a node

coverage: env warm
	OPENBLAS_NUM_THREADS=1 $(BIN)/coverage run -m pytest -n 2 --dist worksteal --timeout 900
	$(BIN)/coverage combine --quiet
	$(BIN)/coverage report

docs: env
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict --site-dir site
	@echo 'open site/index.html'

peers: env
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r benchmarks/peers.lock

lock:
	uv pip compile --quiet --no-strip-extras --universal --python-version 3.11 --extra ros --extra dev --extra docs --extra report --extra watch --extra fleet --extra logs --generate-hashes \
	    --no-header setup.py -o requirements.lock
	uv pip compile --quiet --no-strip-extras --universal --python-version 3.11 --generate-hashes --no-header \
	    --constraints requirements.lock benchmarks/peers.in -o benchmarks/peers.lock

clean:
	rm -rf $(VENV) build install log demo site *.egg-info
