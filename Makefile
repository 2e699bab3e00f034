# Needs python3 (3.11 or 3.12) with its venv module and pip; everything else is installed into $(VENV).
PYTHON ?= python3
VENV ?= .venv
OUT ?= runs/demo
SECONDS ?= 600
SEED ?= 0
ROUNDS ?= 30
# What the demo shows: the paper's three, and the strongest planner.
SHOWN := potential_field replay_irl hybrid mpc

BIN := $(VENV)/bin
VERSION := $(shell $(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null)
# One stamp for each kind of environment; another Python gets another stamp, and so an environment made anew.
PLAIN := $(VENV)/plain-$(VERSION).stamp
ALL := $(VENV)/all-$(VERSION).stamp
INSTALL := $(BIN)/python -m pip install --disable-pip-version-check --quiet -c constraints.txt

# Recordings that may not travel with the project; tests that need them are skipped where they are not.
ifndef SOCIALNAV_MJ_DATA
ifneq ($(wildcard ../shared/data),)
export SOCIALNAV_MJ_DATA := $(abspath ../shared/data)
endif
endif

.DEFAULT_GOAL := help
.PHONY: help install demo shell test slow fuzz kill lint format docs dist clean python-version

help:
	@echo "make demo     run scenario 1, and the beginning of all four, on the embedded crowd; results in $(OUT)"
	@echo "make shell    open a shell that finds the commands of $(BIN)"
	@echo "make test     lint, then the tests"
	@echo "make slow     the longer checks"
	@echo "make fuzz     feed damaged files to every reader for SECONDS=$(SECONDS) on all cores"
	@echo "make kill     kill commands at random moments and repeat them, ROUNDS=$(ROUNDS) times"
	@echo "make lint     format check, lint, types"
	@echo "make format   format and mend what can be mended"
	@echo "make docs     bring the tables of docs/ up to date, and build the site; any error ends it"
	@echo "make dist     build wheel and source distribution, and check them"
	@echo "make clean    remove the environment and the caches, not the results"
	@echo "Choose a Python with PYTHON=python3.12; it has to be 3.11 or 3.12."

# Scenario 1 in full, then the first half minute of all four: more would take more than two minutes on two cores.
demo: $(PLAIN)
	$(BIN)/socialnav-mj evaluate --scenarios 1 --controllers $(SHOWN) --draws 1 --out $(OUT)/full
	$(BIN)/socialnav-mj evaluate --until 30 --controllers $(SHOWN) --draws 1 --out $(OUT)/short
	@echo "Reports: $(OUT)/full/report.html and $(OUT)/short/report.html."
	@echo "Traces: socialnav-mj view $(OUT)/short, with --web in a browser."
	@echo "The commands are in $(abspath $(BIN)); 'make shell' opens a shell that finds them."

install: $(PLAIN)

shell: $(PLAIN)
	@PATH="$(abspath $(BIN)):$$PATH" $${SHELL:-sh}

test: lint
	$(BIN)/python -m pytest -n auto --dist loadfile

slow: $(ALL)
	$(BIN)/python -m pytest -m slow

fuzz: $(ALL)
	$(BIN)/python -m tests.fuzz.run --seconds $(SECONDS) --seed $(SEED)

kill: $(ALL)
	$(BIN)/python -m tests.kill --rounds $(ROUNDS) --seed $(SEED)

lint: $(ALL)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

format: $(ALL)
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

docs: $(ALL)
	$(BIN)/python -c 'from socialnav_mj.report.definitions import write_definitions; write_definitions("docs/metrics.md")'
	$(BIN)/python -m mkdocs build --strict --quiet
	@echo "Site: site/index.html"

dist: $(ALL)
	rm -rf dist
	$(BIN)/python -m build --no-isolation --outdir dist
	$(BIN)/python -m twine check --strict dist/*

clean:
	rm -rf $(VENV) build dist site .pytest_cache .mypy_cache .ruff_cache .hypothesis

python-version:
	@case "$(VERSION)" in \
	3.11|3.12) ;; \
	"") echo "'$(PYTHON)' does not run; install Python 3.11 or 3.12, or name one: make PYTHON=/path/to/python3.12 ..." >&2; exit 1 ;; \
	*) echo "'$(PYTHON)' is Python $(VERSION); 3.11 and 3.12 are supported (dm-control has no wheels for others)." >&2; \
	   echo "Name one of these: make PYTHON=python3.12 ..." >&2; exit 1 ;; \
	esac

$(PLAIN): pyproject.toml constraints.txt | python-version
	@[ -x $(BIN)/python$(VERSION) ] || { echo "Making $(VENV) with Python $(VERSION)"; $(PYTHON) -m venv --clear $(VENV); }
	@echo "Installing (1.1 GB, about half a minute)"
	@$(INSTALL) -e .
	@touch $@

$(ALL): pyproject.toml constraints.txt | python-version
	@[ -x $(BIN)/python$(VERSION) ] || { echo "Making $(VENV) with Python $(VERSION)"; $(PYTHON) -m venv --clear $(VENV); }
	@echo "Installing with training and development tools (some minutes)"
	@$(INSTALL) -e '.[all]'
	@touch $(PLAIN) $@
