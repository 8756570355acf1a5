# Everything to do with shipland. On a fresh machine `make demo` and `make test` do all the set-up themselves.
SHELL := bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.PHONY: help setup setup-run setup-train olympe peers demo test test-slow test-oldest fuzz check bench results docs wheel-test train clean

BIN := .venv/bin
ARGS ?=
SERVE ?=
ONLY ?=

# One thread a process: pytest's workers, or what is measured, share the cores.
test test-slow test-oldest fuzz bench results: export OMP_NUM_THREADS := 1
test test-slow test-oldest fuzz bench results: export OPENBLAS_NUM_THREADS := 1
test test-slow test-oldest fuzz bench results: export LP_NUM_THREADS := 1
# The byte code of tests and sources is kept: pytest rewrites every assertion of a file that has none, in every worker.
test test-slow test-oldest: export PYTHONDONTWRITEBYTECODE :=

help: ## list what there is (default)
	@sed -n 's/^\([a-z-]*\):[^#]*## /\1 @/p' $(MAKEFILE_LIST) | while IFS=@ read -r name what; do printf 'make %-10s %s\n' "$$name" "$$what"; done

setup: ## make .venv with everything that developing needs
	@tools/setup.sh dev

setup-run:
	@tools/setup.sh run

setup-train:
	@tools/setup.sh train

olympe: .venv-olympe/made ## make .venv-olympe with Parrot's SDK, for the ANAFI and its tests
	@.venv-olympe/bin/python -W ignore -c 'import logging; logging.disable(); import olympe'

peers: .venv-peers/made .venv-crazyflow/made ## make .venv-peers with RotorPy and PyFlyt, .venv-crazyflow, for studies/speed_peers.py

.venv-%/made: tools/%.txt | setup
	@$(BIN)/python -m venv .venv-$*
	@.venv-$*/bin/pip install --disable-pip-version-check --quiet -r $<
	@touch $@

demo: setup-run ## fly from 250 m to a ship in sea state 6, camera in the loop: video, plots and log in out/demo/
	$(BIN)/shipland demo $(ARGS)

test: setup ## run the tests but the slow ones; ARGS='-k frames' for some of them
	$(BIN)/pytest -n 6 --dist loadgroup --no-loadscope-reorder -p randomly -m 'not slow' $(ARGS)

test-slow: setup ## run the slow tests: whole processes, also before autopilots and Parrot's own end in real time, and studies
	@$(MAKE) --no-print-directory olympe || echo "no .venv-olympe: the tests of the ANAFI before Olympe are skipped" >&2
	$(BIN)/pytest -n 3 -p randomly -m slow $(ARGS)

.venv-oldest/made: pyproject.toml | setup
	@$(BIN)/python -m venv .venv-oldest
	@.venv-oldest/bin/pip install --disable-pip-version-check --quiet uv
	@.venv-oldest/bin/uv pip install --quiet --python .venv-oldest/bin/python --resolution lowest-direct \
		-e '.[dataset,full,mavlink,mpc,rl,ros2]'
	@.venv-oldest/bin/uv pip install --quiet --python .venv-oldest/bin/python -e '.[dev]' # keeps what is there
	@touch $@

test-oldest: .venv-oldest/made ## run the unit tests with the oldest packages that pyproject.toml allows
	.venv-oldest/bin/pytest -n 4 --dist loadgroup -p randomly -m 'not slow' tests/unit $(ARGS)

fuzz: setup ## hostile inputs for an hour: flights, files, datagrams, signals; findings in out/fuzz/
	$(BIN)/python tools/fuzz.py $(ARGS)

check: setup ## lint, format, types, direction of imports
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: setup ## run the studies of speed: `make results ONLY='speed_*'`
	$(BIN)/python -m studies 'speed_*' $(ARGS)

results: setup ## run the studies into results/, short ones first; hours, resumes; ONLY=name for one, ARGS='--runs 20'
	$(BIN)/python -m studies $(foreach name,$(ONLY),'$(name)') $(ARGS)

train: setup-train ## make the far detectors' weights anew: pictures, training, rounds of what fooled them; four core-hours, resumes
	tools/train_shipped.sh out/train $(ARGS)

docs: setup ## build the documentation into site/, a warning is an error; SERVE=1 shows it at 127.0.0.1:8000
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs $(if $(SERVE),serve,build --quiet) --strict

wheel-test: setup ## build the wheel, install it into an empty environment, fly from another folder
	$(BIN)/python tools/walks.py base

clean: ## remove what was made, but for .venv and .venv-*
	rm -rf out site build dist .pytest_cache .ruff_cache .mypy_cache .import_linter_cache .hypothesis
	find src tests tools studies -name __pycache__ -type d -prune -exec rm -rf {} +
