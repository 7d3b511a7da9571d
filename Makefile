# `make lab` opens the course, `make test` runs the tests, `make site` builds the web site. Each target first creates .venv from
# the exact versions in environment.txt.
#
#   PYTHON=…       the Python to use, such as python3.12 or a path; the default is that of .venv, or the first suitable one of
#                  python3, python3.14, …
#   LAB_ARGS=…     further options for JupyterLab, such as --no-browser or --port=9000
#   SITE_ARGS=…    options for the site, such as "--to DIR" or "notebooks/01_floating_base.ipynb"
#   PYTEST_ARGS=…  further options for pytest, such as "-k friction", tests/control, "--seed 1" or "-n 4"
#   LOCK_ARGS=…    further options for `uv pip compile`, such as --upgrade

.DEFAULT_GOAL := help
.PHONY: help lab test test-all site setup lock live web clean python

VENV := .venv
BIN := $(VENV)/bin
# uv downloads and installs; where it is missing or does not run, pip installs it into .venv first
UV := $(shell uv --version >/dev/null 2>&1 && command -v uv)
PIP := $(BIN)/python -m pip --disable-pip-version-check
INSTALL := $(if $(UV),"$(UV)",{ test -x $(BIN)/uv || $(PIP) install -q -c environment.txt uv; } && $(BIN)/uv) \
	pip install --python $(BIN)/python

# Prints the key of .venv (Python version and folder), then the Python that creates it. A Python that is too old or too new prints
# nothing, and neither does one without venv, unless uv creates .venv.
PROBE := import sys, zlib$(if $(UV),,, ensurepip, venv); \
	(3, 11) <= sys.version_info < (3, 15) or sys.exit(1); \
	print("%d.%d-%x" % (*sys.version_info[:2], zlib.crc32(sys.argv[1].encode())), sys._base_executable)
first_suitable = $(shell for p in $(1); do "$$p" -c '$(PROBE)' "$(CURDIR)" 2>/dev/null && break; done)
FOUND := $(call first_suitable,$(or $(PYTHON),$(BIN)/python python3 python3.14 python3.13 python3.12 python3.11))
# where there is none, uv downloads one
ifeq ($(FOUND)$(PYTHON),)
ifneq ($(and $(UV),$(filter lab test test-all site setup lock live,$(MAKECMDGOALS))),)
FOUND := $(call first_suitable,"$(shell "$(UV)" python install -q 3.13 >&2; "$(UV)" python find 3.13)")
endif
endif
KEY := $(or $(firstword $(FOUND)),none)
BASE := $(wordlist 2,99,$(FOUND))

# two processes share the tests; the slowest tests run first (tests/conftest.py)
WORKERS := -n 2 --dist worksteal

help:
	@echo "make lab     open the course in JupyterLab"
	@echo "make test    run ruff, mypy, the tests and the lessons"
	@echo "make test-all  also test JupyterLab, Voilà, JupyterHub, the site, films and details of the pages"
	@echo "make site    run the lessons and build the web site, into build/site"
	@echo "make setup   only create .venv"
	@echo "make lock    update environment.txt from pyproject.toml"
	@echo "make web     check and build the pages' JavaScript (needs node 20 or later)"
	@echo "make live    compile the controller for web pages again (needs lld and wasi-libc)"
	@echo "make clean   remove .venv and all built files"
	@echo
	@echo "More: PYTHON=python3.12, LAB_ARGS=--no-browser, PYTEST_ARGS='-k friction', LOCK_ARGS=--upgrade"

# the controller compiles while JupyterLab opens
lab: $(VENV)/installed-$(KEY)
	@$(BIN)/floatbase lab notebooks/my $(LAB_ARGS)

test: TIER := -m "not front_end"
test test-all: $(VENV)/tests-$(KEY)
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/python .ci/lint.py
	$(BIN)/python -m pytest $(WORKERS) $(TIER) --durations=30 $(PYTEST_ARGS)

site: $(VENV)/tests-$(KEY)
	$(BIN)/python -m floatbase.lessons.publish site $(SITE_ARGS)

setup: $(VENV)/ready-$(KEY)

# what is printed where an installation fails; the next try starts it again
FAILED := { echo; echo "The set-up is not complete; the reason is above. The network and up to 3 GB of free disk space are needed."; \
	echo "Then run the same command again."; exit 1; } >&2

# .venv is created again if the lock, the Python or the folder has changed, if the last attempt was interrupted, or if the Python
# that .venv links to was removed
GONE := $(shell test -x $(BIN)/python || echo python)
$(VENV)/locked-$(KEY): environment.txt $(GONE) | python
	@echo "Creating $(VENV) with $(BASE): this downloads about 550 MB, takes a minute or two, and needs 2 GB."
	@rm -rf $(VENV)
	@$(if $(UV),"$(UV)" venv -q --seed --python "$(BASE)" $(VENV),"$(BASE)" -m venv $(VENV)) || $(FAILED)
	@{ $(INSTALL) -q -c environment.txt hatchling editables && \
		$(INSTALL) -c environment.txt --no-build-isolation -e ".[course,sweep]" && touch $@; } 2>&1 | grep -vE "^ [-+~] |^ *Downloading "; test -e $@ || $(FAILED)

$(VENV)/installed-$(KEY): $(VENV)/locked-$(KEY) pyproject.toml
	@$(INSTALL) -q --no-deps --no-build-isolation -e . || $(FAILED)
	@touch $@

$(VENV)/ready-$(KEY): $(VENV)/installed-$(KEY)
	@echo "Compiling the controller (once, about a minute)."
	@$(BIN)/python -m floatbase compile >/dev/null 2>&1 || $(BIN)/python -m floatbase compile
	@touch $@

# packages that only the tests and the site need
$(VENV)/tests-$(KEY): $(VENV)/ready-$(KEY)
	@echo "Installing the packages that only the tests and the site need."
	@$(INSTALL) -q -r environment.txt || $(FAILED)
	@touch $@

python:
	@if [ -z "$(FOUND)" ]; then \
		echo "floatbase needs Python 3.11, 3.12, 3.13 or 3.14 with the venv module. $(or $(PYTHON),python3) is not suitable."; \
		$(if $(PYTHON),,$(if $(UV),echo "uv did not bring one; the reason is above.";,\
			echo "Install uv, which brings its own Python, and run make again:"; \
			echo "    curl -LsSf https://astral.sh/uv/install.sh | sh      (or: pipx install uv, brew install uv)";)) \
		echo "$(if $(PYTHON)$(UV),Install,Or install) a Python (on Debian and Ubuntu: apt install python3-venv), or name one:"; \
		echo "    make $(or $(MAKECMDGOALS),lab) PYTHON=/path/to/python3.13"; \
		exit 1; \
	fi >&2

# keeps the versions in environment.txt that still fit; LOCK_ARGS=--upgrade uses the newest. The extra `test` contains all others.
lock: | python
	"$(BASE)" -m venv build/uv
	build/uv/bin/python -m pip --disable-pip-version-check install -q uv
	build/uv/bin/uv pip compile -q --universal --python-version 3.11 --fork-strategy fewest \
		--extra test --no-annotate --no-emit-index-url \
		--custom-compile-command "make lock" $(LOCK_ARGS) pyproject.toml -o environment.txt

# floatbase/viewer/web/dist is committed, so Node.js is needed only to change the JavaScript
web:
	cd floatbase/viewer/web && npm ci --no-audit --no-fund && npm run lint && npm test && npm run build

# floatbase/live/tick.wasm is committed, so wasm-ld is needed only after a change to control/tick
live: $(VENV)/ready-$(KEY)
	$(BIN)/python -m floatbase.lessons.publish live

clean:
	rm -rf $(VENV) build dist floatbase/viewer/web/node_modules .ci/proxy/node_modules .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
