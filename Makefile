# `make lab` opens the course, `make test` runs the tests, `make site` builds the web site. Each target first creates .venv from
# the exact versions in environment.txt.
#
#   PYTHON=…       the Python to use, such as python3.12 or a path; the default is that of .venv, or the first suitable one of
#                  python3, python3.13, …
#   LAB_ARGS=…     further options for JupyterLab, such as --no-browser or --port=9000
#   SITE_ARGS=…    options for the site, such as "--to DIR" or "notebooks/01_floating_base.ipynb"
#   PYTEST_ARGS=…  further options for pytest, such as "-k friction", tests/control, "--seed 1" or "-n 4"
#   LOCK_ARGS=…    further options for `uv pip compile`, such as --upgrade

.DEFAULT_GOAL := help
.PHONY: help lab test test-all site setup lock live web clean python

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check

# Prints the key of .venv (Python version and folder), then the Python that creates it.
# An unsuitable Python, or one without venv, prints nothing.
PROBE := import ensurepip, sys, venv, zlib; \
	(3, 11) <= sys.version_info < (3, 14) or sys.exit(1); \
	print("%d.%d-%x" % (*sys.version_info[:2], zlib.crc32(sys.argv[1].encode())), sys._base_executable)
FOUND := $(shell for p in $(or $(PYTHON),$(BIN)/python python3 python3.13 python3.12 python3.11); do \
	"$$p" -c '$(PROBE)' "$(CURDIR)" 2>/dev/null && break; done)
KEY := $(or $(firstword $(FOUND)),none)
BASE := $(wordlist 2,99,$(FOUND))

# the extension of JupyterLab that fetches news and updates; disabled in .venv
NEWS := @jupyterlab/apputils-extension:announcements
FIRST := /lab/tree/my/00_start_here.ipynb
# JupyterLab's list of open tabs; kept with this copy of the course, so that tabs of another copy do not open here
TABS := $(CURDIR)/$(VENV)/workspaces

# two processes share the tests; the slowest tests run first (tests/conftest.py)
WORKERS := -n 2 --dist worksteal

# JupyterLab's autosave interval [s]; its default is two minutes
SAVING := {"@jupyterlab/docmanager-extension:plugin": {"autosaveInterval": 30}}
SETTINGS := $(VENV)/share/jupyter/lab/settings
# the course needs no language servers, and the search for them prints a long list of those not installed
QUIET := --LanguageServerManager.autodetect=False

# shortens pip's output to a line for every twentieth package, and one before the unpacking
PROGRESS := n=0; while read -r what which rest; do case "$$what $$which" in \
	"Collecting "* | "Processing "*) n=$$((n + 1)); [ $$((n % 20)) != 0 ] || echo "  $$n packages found";; \
	"Installing collected") echo "  unpacking: about a minute";; esac; done

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

lab: setup
	@$(BIN)/python -m floatbase.lessons.publish workspace
	@mkdir -p $(SETTINGS) && echo '$(SAVING)' > $(SETTINGS)/overrides.json
	$(BIN)/jupyter lab --ServerApp.root_dir=notebooks --LabApp.default_url=$(FIRST) --ServerApp.ip=127.0.0.1 \
		--LabApp.workspaces_dir="$(TABS)" --LabApp.extension_manager=readonly $(QUIET) $(if $(filter 0,$(shell id -u)),--allow-root) $(LAB_ARGS)

test: TIER := -m "not front_end"
test test-all: $(VENV)/tests-$(KEY)
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/python .ci/lint.py
	$(BIN)/python -m pytest $(WORKERS) $(TIER) --durations=30 $(PYTEST_ARGS)

site: $(VENV)/tests-$(KEY)
	$(BIN)/python -m floatbase.lessons.publish site $(SITE_ARGS)

setup: $(VENV)/ready-$(KEY)

# .venv is created again if the lock, the Python or the folder has changed, or if the last attempt was interrupted
$(VENV)/locked-$(KEY): environment.txt | python
	@echo "Creating $(VENV) with $(BASE): about 2 GB, a few minutes the first time."
	@rm -rf $(VENV)
	@"$(BASE)" -m venv $(VENV)
	@$(PIP) install -q -c environment.txt hatchling editables
	@{ PYTHONUNBUFFERED=1 $(PIP) install --progress-bar=off -c environment.txt --no-build-isolation -e ".[course]" && \
		$(BIN)/jupyter labextension disable $(NEWS) >/dev/null 2>&1 && touch $@; } | { $(PROGRESS); }
	@test -e $@  # the pipe above hides a failure of pip

$(VENV)/ready-$(KEY): $(VENV)/locked-$(KEY) pyproject.toml
	@$(PIP) install -q --no-deps --no-build-isolation -e .
	@echo "Compiling the controller (once, about a minute)."
	@$(BIN)/python -m floatbase compile >/dev/null 2>&1 || $(BIN)/python -m floatbase compile
	@touch $@

# packages that only the tests and the site need
$(VENV)/tests-$(KEY): $(VENV)/ready-$(KEY)
	@echo "Installing the packages that only the tests and the site need."
	@$(PIP) install -q -r environment.txt
	@touch $@

python:
	@if [ -z "$(FOUND)" ]; then \
		echo "floatbase needs Python 3.11, 3.12 or 3.13 with the venv module. $(or $(PYTHON),python3) is not suitable."; \
		echo "Install one (on Debian and Ubuntu: apt install python3 python3-venv), or name one:"; \
		echo "    make $(or $(MAKECMDGOALS),lab) PYTHON=/path/to/python3.12"; \
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
