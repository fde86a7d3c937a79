# `make demo` and `make test` need a Python >= 3.11, make and the package index; all else goes into
# .venv. A Python of your choice: make PYTHON=python3.12 test

.DEFAULT_GOAL := help
# some hundred processes of the tests load this package: compiled once, not by each of them
unexport PYTHONDONTWRITEBYTECODE
.PHONY: help demo test tests perf test-long pythons lowest lock audit coverage vcan docs lint bench figures paper view-bundle release clean

LONG ?= long or hypothesis
PROFILE ?= ci-long
VENV := .venv
BIN := $(VENV)/bin
USABLE := import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))
PYTHON ?= $(shell for p in python3 python3.14 python3.13 python3.12 python3.11; do \
	"$$p" -c '$(USABLE)' >/dev/null 2>&1 && echo "$$p" && break; done)
PYTHONS ?= python3.11 python3.12 python3.13 python3.14
PIP := $(BIN)/python -m pip --quiet --disable-pip-version-check
# uv takes a seventh of pip's time; where it is not to be had, or finds no index, pip does it. Both
# install what requirements/ states, by hash; `make lock` states it anew. What users run is compiled
# to bytecode at once, as pip does: the first command would wait for it else.
UV := $(BIN)/python -m uv pip install --quiet --python $(BIN)/python
HASHED := --require-hashes -r requirements
LOCK := $(BIN)/python -m uv pip compile --quiet --universal --python-version 3.11 --upgrade \
	--generate-hashes --no-emit-index-url --no-annotate --no-header
ITSELF := --no-deps --no-build-isolation -e .
# long tests wait much, for clocks and other processes: one more of them than there are cores
BESIDE := $(shell expr $$(getconf _NPROCESSORS_ONLN 2>/dev/null || echo 2) + 1)
MADE := $(VENV)/made
RUNTIME := $(VENV)/installed
DEV := $(VENV)/installed-dev
MACHINE_CODE := $(wildcard hil/*/*.c)

help:
	@echo 'make demo     measure, identify and report on the virtual manutec-r15, into runs/'
	@echo 'make test     every check, and every test that is not long'
	@echo 'make test-long   the others: whole sessions, studies, tutorials, browsers; property tests anew'
	@echo 'make perf     the work of some commands, counted, and kernels against NumPy'
	@echo 'make pythons  the same under every Python that is here, of $(PYTHONS)'
	@echo 'make lowest   the tests with the lowest versions of all packages that users need'
	@echo 'make lock     requirements/: versions and hashes of all packages, stated anew'
	@echo 'make audit    known weaknesses of these packages'
	@echo 'make coverage the tests, and how many lines they reach'
	@echo 'make vcan     the tests on SocketCAN, in a QEMU guest where the kernel has no vcan0'
	@echo 'make docs     the documentation as a site, into build/docs'
	@echo 'make lint     the checks alone: ruff, mypy, import-linter'
	@echo 'make bench    the benchmarks, and which figures have changed since they were kept'
	@echo 'make figures  figures of README and docs from benchmarks/results'
	@echo 'make paper    docs/explanation/paper.md: the paper line by line; takes hours'
	@echo 'make view-bundle   the scripts of the pages of hil view and --live, from web/; takes npm'
	@echo 'make release VERSION=0.2.0   changelog, citation, tag, wheel and site of a release'
	@echo 'make clean    remove .venv and caches; runs/ stays'

demo: $(RUNTIME)
	@sh examples/demo.sh $(BIN)/hil

# side by side: mypy keeps one core busy, and the tests wait for it at times
test: $(DEV)
	@$(MAKE) --no-print-directory -j 2 lint tests
	@$(MAKE) --no-print-directory perf

tests: $(DEV)
	$(BIN)/pytest -n auto --dist worksteal -m 'not long'

# the work of some commands, counted: no clock, no other process changes it; what it is to be stands
# in tools/counts.json
perf: $(RUNTIME)
	$(BIN)/python tools/counts.py

# The tests of a file share a worker, and so what is made once for all of them; those files that take
# longest come first (tests/conftest.py). Property tests draw new examples; what fails is kept in
# .hypothesis/found.
test-long: $(DEV)
	$(BIN)/pytest -n $(BESIDE) --dist loadfile --no-loadscope-reorder -m '$(LONG)' \
		--hypothesis-profile=$(PROFILE)

# each in an environment of its own, .venv-3.12 and so on; the last line names those that are not here
pythons:
	@set -e; missing=; for python in $(PYTHONS); do \
		if ! "$$python" -c '$(USABLE)' >/dev/null 2>&1; then missing="$$missing $$python"; continue; fi; \
		number=$$("$$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])'); \
		echo "== Python $$number"; \
		$(MAKE) --no-print-directory VENV=".venv-$$number" PYTHON="$$python" test; \
	done; \
	if [ -n "$$missing" ]; then echo "not tested, since they are not here:$$missing"; fi

# what users may have at least, with any version of what only tests need; old ones warn of new ones.
# uv, since pip fetches whole packages to find versions that go together, for more than an hour
lowest:
	@mkdir -p build
	@'$(PYTHON)' tools/lowest.py > build/lowest.txt
	@'$(PYTHON)' -m venv .venv-lowest
	@.venv-lowest/bin/python -m pip --quiet install uv
	@.venv-lowest/bin/python -m uv pip install --quiet -r build/lowest.txt 'setuptools>=77' \
		--python .venv-lowest/bin/python
	@.venv-lowest/bin/python -m pip --quiet install --no-deps --no-build-isolation -e .
	.venv-lowest/bin/pytest -n auto --dist worksteal -m 'not long' -W default

# by itself, because it doubles the time of the tests
coverage: $(DEV)
	$(BIN)/pytest -n auto --dist loadfile --cov --cov-report=
	@for package in checked_files hil drivers sim_plant; do \
		echo "lines covered of $$package: $$($(BIN)/coverage report --include="$$package/*" --format=total) %"; \
	done

# versions and hashes of all packages, for every Python and platform; without addresses of an index
lock: $(DEV)
	@echo uv | $(LOCK) - -o requirements/uv.txt
	@echo pip-audit | $(LOCK) - -o requirements/audit.txt
	@echo 'setuptools>=77' | $(LOCK) pyproject.toml - -o requirements/run.txt
	@$(LOCK) pyproject.toml --group pyproject.toml:dev -o requirements/dev.txt

# known weaknesses of the packages; asks the index, so that no other target depends on it
audit:
	@'$(PYTHON)' -m venv .venv-audit
	@.venv-audit/bin/python -m pip --quiet install $(HASHED)/audit.txt
	.venv-audit/bin/pip-audit --require-hashes --disable-pip -r requirements/dev.txt

vcan: $(DEV)
	@sh tools/test_on_vcan.sh

docs: $(DEV)
	$(BIN)/sphinx-build -q -W --keep-going docs build/docs
	@echo 'the documentation begins with build/docs/index.html'

lint: $(DEV)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo
	$(BIN)/python tools/english.py

bench: $(DEV)
	@failed=; for file in $$(grep -l '__main__' benchmarks/*.py); do \
		case "$$file" in */figures.py | */over_time.py) continue ;; esac; \
		echo "== $$file"; $(BIN)/python "$$file" || failed="$$failed $$file"; \
	done; \
	if [ -n "$$failed" ]; then echo "not measured, as they state above:$$failed"; fi
	@echo '== since the last commit'
	@$(BIN)/python benchmarks/over_time.py

figures: $(DEV)
	$(BIN)/python benchmarks/figures.py

# recordings stay in runs/paper, so that a second call measures what is missing
paper: $(DEV)
	$(BIN)/python -m benchmarks.drift_study -o runs/paper --minutes 10 --seeds 20 --first-seed 201 \
		--scenario off --scenario strong --kind trajectory --kind compensated
	$(BIN)/python -m benchmarks.paper runs/paper

# the result is committed, and a test finds it out of date: nobody else needs npm
view-bundle:
	@cd web && npm ci --silent && npm run --silent build

# nothing is pushed or uploaded: its last lines state how
release: $(DEV)
	@$(BIN)/sphinx-build -q -W --keep-going docs build/docs  # what cannot be documented is not released
	@$(BIN)/python tools/release.py '$(VERSION)'
	@$(MAKE) --no-print-directory docs

clean:
	rm -rf .venv .venv-* build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .import_linter_cache
	rm -rf .hypothesis .coverage .coverage.*
	find hil drivers sim_plant tests benchmarks -name __pycache__ -prune -exec rm -rf {} +

$(MADE):
	@test -n '$(PYTHON)' || { echo 'No Python >= 3.11 with venv and ensurepip was found. Install one' \
		'(Debian: apt install python3 python3-venv), or name it: make PYTHON=/path/to/python3' >&2; exit 1; }
	@'$(PYTHON)' -c '$(USABLE)' 2>/dev/null || { echo '$(PYTHON) is no Python >= 3.11 with venv and' \
		'ensurepip; name another: make PYTHON=/path/to/python3' >&2; exit 1; }
	@echo 'making $(VENV) with $(PYTHON)'
	@'$(PYTHON)' -m venv $(VENV)
	@touch $@

$(RUNTIME): pyproject.toml $(MACHINE_CODE) requirements/run.txt | $(MADE)
	@echo 'installing what it needs into $(VENV), once'
	@{ $(PIP) install $(HASHED)/uv.txt && $(UV) --compile-bytecode $(HASHED)/run.txt; } 2>/dev/null || \
		$(PIP) install $(HASHED)/run.txt
	@$(UV) $(ITSELF) 2>/dev/null || $(PIP) install $(ITSELF)
	@$(BIN)/python -m compileall -q hil drivers sim_plant
	@touch $@

$(DEV): requirements/dev.txt $(RUNTIME)
	@echo 'installing its checks into $(VENV); half a minute, once'
	@{ $(PIP) install $(HASHED)/uv.txt && $(UV) $(HASHED)/dev.txt; } 2>/dev/null || \
		$(PIP) install $(HASHED)/dev.txt
	@touch $@
