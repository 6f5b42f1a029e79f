# Each target sets up what it needs: .venv with the package, and the system's libraries by apt.
SHELL := /bin/bash
PYTHON ?= $(shell for p in python3 python3.12 python3.11 python3.13; do \
    $$p -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] < (3, 14))' 2>/dev/null && echo $$p && exit; \
    done; echo python3)
VENV := .venv
BIN := $(VENV)/bin
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: setup demo test test-slow lint bench bench-slow clean

setup: $(VENV)/.ready

$(VENV)/.ready: pyproject.toml .ci/system
	@PYTHON="$(PYTHON)" .ci/system
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

demo: setup
	@$(BIN)/tablemap process recordings/demo.mcap --output runs
	@echo "the command is $(BIN)/tablemap"

test: setup
	@$(BIN)/python -m pytest -q -n 2 --dist loadfile -m "not slow" --ignore tests/benchmarks

test-slow: setup
	@$(BIN)/python -m pytest -q -n 2 --dist loadfile -m slow --ignore tests/benchmarks

lint: setup
	@$(BIN)/ruff format --check .
	@$(BIN)/ruff check .
	@$(BIN)/mypy
	@$(BIN)/lint-imports --no-logo

bench: setup
	@$(BIN)/python -m pytest -q tests/benchmarks --benchmark-only -m "not slow"

bench-slow: setup
	@$(BIN)/python -m pytest -q tests/benchmarks --benchmark-only -m slow

clean:
	rm -rf $(VENV) build *.egg-info .mypy_cache .ruff_cache .pytest_cache
