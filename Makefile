# make          create .venv with everything the project needs
# make demo     compare ten solvers on built-in data, print the table, write the report to demo-results/
# make test     every test
# make browser  look at the demo's report in a headless Chromium (installed, or named in NONRIGID_BROWSER)
# make check    lint, format, types, layers
# make docs     run the tutorial, draw its figures, build the site into site/

PYTHON ?= python3
BIN := .venv/bin
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1

.PHONY: all demo test browser check docs clean

all: .venv/ready

.venv/ready: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys, venv, ensurepip; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' 2>/dev/null || \
	  { echo "$(PYTHON) is no Python 3.11, 3.12 or 3.13 with venv; name one: make PYTHON=python3.12" >&2; exit 1; }
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	mkdir -p .types/nonrigid
	for room in geometry formulations solvers benchmark; do ln -sfn ../../$$room .types/nonrigid/$$room; done
	touch $@

demo: .venv/ready
	$(BIN)/nonrigid bench demo --out demo-results --jobs 2 >/dev/null
	$(BIN)/nonrigid report demo-results

test: .venv/ready
	$(BIN)/python -m pytest -n 2

browser: demo
	$(BIN)/python tests/browser/check.py demo-results

check: .venv/ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy benchmarks docs/*.py
	$(BIN)/lint-imports

.venv/docs: .venv/ready
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[docs]'
	touch $@

docs: .venv/docs
	$(BIN)/python docs/run_tutorial.py
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict
	@echo "Site: $(CURDIR)/site/index.html"

clean:
	rm -rf .venv .types build dist site docs/generated *.egg-info demo-results .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
