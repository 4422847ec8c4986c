# Every target sets up .venv by itself, and again only when pyproject.toml or constraints.txt change.
PYTHON   ?= python3
EPISODES ?= 100
OUT      ?= reports/
ARGS     ?=

VENV   := .venv
PY     := $(VENV)/bin/python
BASE   := $(VENV)/.stamp-venv
REPORT := $(VENV)/.stamp-report
TEST   := $(VENV)/.stamp-test
INPUTS := pyproject.toml constraints.txt
INSTALL = $(PY) -m pip install --quiet -c constraints.txt -e

.DEFAULT_GOAL := help
.PHONY: help report report-full thesis test check bench clean
.NOTPARALLEL:
.DELETE_ON_ERROR:

help: ## Show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-11s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

report: $(REPORT) ## Learned and classical policies on the four environments (EPISODES=100 OUT=reports/)
	$(PY) -m agents report --episodes $(EPISODES) --out $(OUT) $(ARGS)

report-full: $(REPORT) ## The same with all seeds for mpc and finer fronts; continues after an interrupt
	$(PY) -m agents report --episodes $(EPISODES) --slow-episodes $(EPISODES) --sweep-episodes 50 --bound-episodes 20 \
		--fine --resume --out $(OUT)

thesis: $(REPORT) ## The source thesis's figures and claims, reproduced (OUT=reports/): OUT/thesis/thesis.html
	$(PY) -m baselines thesis --out $(patsubst %/,%,$(OUT))/thesis $(ARGS)

test: $(TEST) ## Run the tests (ARGS="-k kalman -n 0")
	$(PY) -m pytest $(ARGS)

check: $(TEST) ## Lint, format and type checks
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	$(PY) -m mypy

bench: $(REPORT) ## Measure environment steps per second (ARGS="...")
	$(PY) -m formation_env bench $(ARGS)

clean: ## Remove .venv, caches and build products; keeps reports/ and runs/
	rm -rf $(VENV) build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# A stamp is touched last and the old ones are removed first, so an interrupted set-up is done again.
$(BASE):
	$(PYTHON) -m venv --clear $(VENV)
	$(PY) -m pip install --quiet --upgrade pip
	touch $@

$(REPORT): $(INPUTS) | $(BASE)
	rm -f $(REPORT) $(TEST)
	$(INSTALL) '.[report,optimal]'
	touch $@

# The test extras include the report's, so this set-up stands for both.
$(TEST): $(INPUTS) | $(BASE)
	rm -f $(REPORT) $(TEST)
	$(INSTALL) '.[report,optimal,rl,video,dev]'
	touch $(REPORT) $@
