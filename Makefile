# The project's commands. Each first sets up what it needs, so that a fresh clone needs nothing but make.
.DEFAULT_GOAL := help
PYTHON := .venv/bin/python
DEMO := grain_on_bed
# Two files of tests at a time, in the order of their folders, those without a flow last (tests/conftest.py).
BESIDE := -n 2 --dist loadfile --no-loadscope-reorder
# Passed on to pytest, as in: make test ARGS="-k contact -x"
ARGS ?=
# One part of the slow tests, or all (tests/slow_parts.py).
PART ?= all

# Parallelism is MPI's: threads of the linear algebra would only compete with its ranks.
export OMP_NUM_THREADS := 1
# Bytecode of tests is kept whatever the environment says: each process takes seconds to make it.
unexport PYTHONDONTWRITEBYTECODE
# Open MPI refuses to run as root, which is what one is in most containers.
export OMPI_ALLOW_RUN_AS_ROOT := 1
export OMPI_ALLOW_RUN_AS_ROOT_CONFIRM := 1

.PHONY: help setup demo test test-quick test-slow regression test-debian13 test-wheel lint types docs docs-commands gallery bench cost calibration certified effects gusts shields turbulence stress surface channels clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z0-9-]+:.*## / { printf "make %-14s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: ## install what is missing: Debian's packages and .venv
	@./setup.sh

demo: setup ## a grain on a bed: verdict, pictures and ParaView files
	.venv/bin/incipient run demos/scenes/$(DEMO).toml --out results/$(DEMO) --set output.pictures=true

test: setup ## the default tests (ARGS="-k name -x" goes to pytest)
	$(PYTHON) -m pytest $(BESIDE) $(ARGS)

test-quick: setup ## the tests that need no flow: under a minute
	$(PYTHON) -m pytest -m "quick and not slow" $(BESIDE) $(ARGS)

test-slow: setup ## the tests that take minutes, in parts of at most half an hour (PART=space; PART=all)
	@files=$$($(PYTHON) tests/slow_parts.py $(PART)) && $(PYTHON) -m pytest -m slow $(BESIDE) $(ARGS) $$files

regression: setup ## 42 command lines against stored results, in parts (PART=plane, unsteady, surface, space, turbulence, threshold, judge)
	$(PYTHON) -m pytest tests/regression -m regression -n 2 $(ARGS) $(if $(filter all,$(PART)),,-k $(PART)-)

test-debian13: ## the default tests on Debian 13, in a directory of its own (as root)
	.ci/debian13 packages $(ARGS)

test-wheel: ## the default tests with the dolfinx that PyPI has, on Debian 13's Python (as root)
	.ci/debian13 wheel $(ARGS)

lint: setup ## ruff: rules and format; import-linter: layers
	$(PYTHON) -m ruff check
	$(PYTHON) -m ruff format --check
	.venv/bin/lint-imports --no-logo

types: setup ## mypy
	$(PYTHON) -m mypy

# MkDocs says that Material will be replaced one day; that is no warning of these pages.
docs: setup ## the documentation: pages of reference, site/index.html, without warnings, links checked
	@$(PYTHON) -c "import latex2mathml, material" 2>/dev/null || $(PYTHON) -m pip install --quiet --disable-pip-version-check --no-build-isolation --editable '.[docs]'
	$(PYTHON) docs/reference.py
	NO_MKDOCS_2_WARNING=1 $(PYTHON) -m mkdocs build --strict

docs-commands: setup ## every command on every page, run once: hours (PAGE=howto/sweeps.md for one page)
	$(PYTHON) docs/commands.py $(PAGE)

gallery: setup ## the pictures of docs/gallery.md, from runs of the demos
	$(PYTHON) benchmarks/gallery.py $(ARGS)

bench: setup ## speed and accuracy beside other programs
	$(PYTHON) benchmarks/run.py

cost: setup ## what accuracy costs, on the demos: docs/validation/cost.md
	$(PYTHON) benchmarks/accuracy_cost.py

calibration: setup ## corrected forces and their error bars beside runs with much smaller errors: docs/validation/performance.md
	$(PYTHON) benchmarks/calibration.py $(ARGS)

certified: setup ## what a certified error of the force costs, with and without corrections: docs/validation/performance.md
	$(PYTHON) benchmarks/certified.py $(ARGS)

effects: setup ## one scene with its effects switched on one after another: docs/validation/effects.md
	$(PYTHON) benchmarks/effects.py

gusts: setup ## the weakest gusts that move a grain out of its pocket, between their limits: docs/explanation/moving.md
	$(PYTHON) benchmarks/gust_curve.py $(ARGS)

shields: setup ## a natural bed and beads in a fluctuating stream beside flumes and balances of forces: docs/validation/shields.md
	$(PYTHON) benchmarks/natural_bed.py
	$(PYTHON) benchmarks/shields.py

turbulence: setup ## turbulent channels, a step and a stone beside OpenFOAM, a hump, against measurements: docs/validation/turbulence.md
	$(PYTHON) benchmarks/turbulence.py
	$(PYTHON) benchmarks/turbulent_meshes.py
	$(PYTHON) benchmarks/turbulent_hump.py

stress: setup ## the map of where a body's step can be solved: docs/validation/hard_cases.md
	PYTHONPATH=tests:tests/stability $(PYTHON) benchmarks/stress_map.py

surface: setup ## free surfaces against exact solutions, and the demos: the numbers of docs/explanation/surface.md
	$(PYTHON) -m pytest tests/convergence/test_waves.py tests/stability/test_surface.py tests/end_to_end/test_free_surface.py -m "slow or not slow"
	for demo in standing_wave sloshing grain_under_waves floating_body; do .venv/bin/python demos/$$demo.py; done
	.venv/bin/incipient run demos/scenes/sphere_under_waves.toml --out results/sphere_under_waves

channels: setup ## channels with a free surface: the numbers of docs/explanation/surface.md
	$(PYTHON) -m pytest tests/convergence/test_channels.py tests/end_to_end/test_open_channels.py -m "slow or not slow"
	.venv/bin/python demos/grain_in_channel.py

clean: ## remove caches, build leftovers and the demo's results, not .venv
	rm -rf results/$(DEMO) site build dist incipient.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -not -path './.venv/*' -prune -exec rm -rf {} +
