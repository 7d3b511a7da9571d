# `make lab` opens the course, `make test` tests it, `make site` builds the web site. All first make .venv, from the exact lock
# in environment.txt.
#
#   PYTHON=…       the Python to use, such as python3.12 or a path; without it that of .venv, or the first of python3, python3.13, …
#                  that fits
#   LAB_ARGS=…     more options for JupyterLab, such as --no-browser or --port=9000
#   SITE_ARGS=…    options for the site, such as "--to DIR" or "notebooks/01_floating_base.ipynb"
#   PYTEST_ARGS=…  more options for pytest, such as "-k friction", tests/control, "--seed 1" or "-n 4"
#   LOCK_ARGS=…    more options for `uv pip compile`, such as --upgrade

.DEFAULT_GOAL := help
.PHONY: help lab test test-all site setup lock web clean python

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check

# Prints what .venv must have been made for (Python and place, as a key), then the Python that makes it.
# A Python that does not fit, or has no venv, prints nothing.
PROBE := import ensurepip, sys, venv, zlib; \
	(3, 11) <= sys.version_info < (3, 14) or sys.exit(1); \
	print("%d.%d-%x" % (*sys.version_info[:2], zlib.crc32(sys.argv[1].encode())), sys._base_executable)
FOUND := $(shell for p in $(or $(PYTHON),$(BIN)/python python3 python3.13 python3.12 python3.11); do \
	"$$p" -c '$(PROBE)' "$(CURDIR)" 2>/dev/null && break; done)
KEY := $(or $(firstword $(FOUND)),none)
BASE := $(wordlist 2,99,$(FOUND))

# the part of JupyterLab that asks the network for news and updates, off in .venv
NEWS := @jupyterlab/apputils-extension:announcements
FIRST := /lab/tree/my/00_start_here.ipynb
# which tabs were open is kept with this copy of the course, so that tabs of another copy do not open here
TABS := $(CURDIR)/$(VENV)/workspaces

# two processes share the tests; the slowest come first (tests/conftest.py)
WORKERS := -n 2 --dist worksteal

# how often JupyterLab saves, s; its own is every two minutes
SAVING := {"@jupyterlab/docmanager-extension:plugin": {"autosaveInterval": 30}}
SETTINGS := $(VENV)/share/jupyter/lab/settings
# the course needs no language servers; looking for them ends in a long line about all that are not installed
QUIET := --LanguageServerManager.autodetect=False

# what pip says, boiled down: a line for every tenth package, and one before the long end
PROGRESS := n=0; while read -r what which rest; do case "$$what $$which" in \
	"Collecting "* | "Processing "*) n=$$((n + 1)); [ $$((n % 20)) != 0 ] || echo "  $$n packages found";; \
	"Installing collected") echo "  unpacking them all: about a minute";; esac; done

help:
	@echo "make lab     open the course in JupyterLab"
	@echo "make test    run ruff, mypy, the tests and the lessons"
	@echo "make test-all  also test JupyterLab, Voilà, a hub, the site, films and every detail of the pages"
	@echo "make site    run the lessons and build the web site, into build/site"
	@echo "make setup   only make .venv"
	@echo "make lock    write environment.txt anew from pyproject.toml"
	@echo "make web     check and build the pages' JavaScript (needs node 20 or later)"
	@echo "make clean   remove .venv and everything else that was made"
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

# .venv is made from nothing whenever the lock, the Python or the place changed, or the last try did not come to its end
$(VENV)/locked-$(KEY): environment.txt | python
	@echo "Making $(VENV) with $(BASE): about 2 GB, a few minutes the first time."
	@rm -rf $(VENV)
	@"$(BASE)" -m venv $(VENV)
	@$(PIP) install -q -c environment.txt hatchling editables
	@{ PYTHONUNBUFFERED=1 $(PIP) install --progress-bar=off -c environment.txt --no-build-isolation -e ".[course]" && \
		$(BIN)/jupyter labextension disable $(NEWS) >/dev/null 2>&1 && touch $@; } | { $(PROGRESS); }
	@test -e $@  # the pipe above forgets whether pip failed

$(VENV)/ready-$(KEY): $(VENV)/locked-$(KEY) pyproject.toml
	@$(PIP) install -q --no-deps --no-build-isolation -e .
	@echo "Compiling the controller, once: about a minute."
	@$(BIN)/python -m floatbase compile >/dev/null 2>&1 || $(BIN)/python -m floatbase compile
	@touch $@

# what only tests and the site need
$(VENV)/tests-$(KEY): $(VENV)/ready-$(KEY)
	@echo "Adding to $(VENV) what only tests and the site need."
	@$(PIP) install -q -r environment.txt
	@touch $@

python:
	@if [ -z "$(FOUND)" ]; then \
		echo "floatbase needs Python 3.11, 3.12 or 3.13 with its venv module; $(or $(PYTHON),python3) is not that."; \
		echo "Install one (on Debian and Ubuntu: apt install python3 python3-venv), or say where it is:"; \
		echo "    make $(or $(MAKECMDGOALS),lab) PYTHON=/path/to/python3.12"; \
		exit 1; \
	fi >&2

# keeps the versions in environment.txt where they still fit; LOCK_ARGS=--upgrade takes the newest;
# the extra test contains all others
lock: | python
	"$(BASE)" -m venv build/uv
	build/uv/bin/python -m pip --disable-pip-version-check install -q uv
	build/uv/bin/uv pip compile -q --universal --python-version 3.11 --fork-strategy fewest \
		--extra test --no-annotate --no-emit-index-url \
		--custom-compile-command "make lock" $(LOCK_ARGS) pyproject.toml -o environment.txt

# floatbase/viewer/web/dist is committed, so only who changes the JavaScript needs node
web:
	cd floatbase/viewer/web && npm ci --no-audit --no-fund && npm run lint && npm test && npm run build

clean:
	rm -rf $(VENV) build dist floatbase/viewer/web/node_modules .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
