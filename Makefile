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
# OpenBLAS chooses its kernels by the processor; these are the common ones. Nehalem multiplies without fused adds.
CORES     := Haswell Zen SkylakeX Nehalem
NUMERICAL := tests/baselines/design/test_riccati.py tests/baselines/design/test_riccati_solver.py tests/baselines/design/test_transfers.py \
             tests/baselines/design/test_steady_state_filter.py tests/baselines/controllers/test_policy_settings.py \
             tests/formation_env/dynamics/test_dynamics.py tests/formation_env/orbital
# Tests that fly episodes compile the step, which has no BLAS.
NOT_FLOWN := not compiled_filter and not innovations and not in_flight and not flies
COMPILED  := tests/formation_env/numerics tests/formation_env/kernel/test_kalman.py \
             tests/formation_env/kernel/test_kalman_extremes.py
INSTALL = $(PY) -m pip install --quiet -c constraints.txt -e

.DEFAULT_GOAL := help
.PHONY: help report report-full results thesis test test-portable check bench clean
.NOTPARALLEL:
.DELETE_ON_ERROR:

help: ## Show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-13s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

report: $(REPORT) ## Learned and classical policies on the four environments (EPISODES=100 OUT=reports/)
	$(PY) -m agents report --episodes $(EPISODES) --out $(OUT) $(ARGS)

report-full: $(REPORT) ## The same with all seeds for mpc and finer fronts; continues after an interrupt
	$(PY) -m agents report --episodes $(EPISODES) --slow-episodes $(EPISODES) --sweep-episodes 50 --bound-episodes 20 \
		--fine --resume --out $(OUT)

results: report ## The report's tables into docs/results.md and README.md
	$(PY) docs/update_results.py $(OUT)

thesis: $(REPORT) ## The source thesis's figures and claims, reproduced (OUT=reports/): OUT/thesis/thesis.html
	$(PY) -m baselines thesis --out $(patsubst %/,%,$(OUT))/thesis $(ARGS)

test: $(TEST) ## Run the tests (ARGS="-k kalman -n 0")
	$(PY) -m pytest $(ARGS)

test-portable: $(TEST) ## Numerical tests under the arithmetic of other processors (docs/portability.md)
	@for core in $(CORES); do \
		if [ $$core = SkylakeX ] && ! grep -q avx512f /proc/cpuinfo; then echo "SkylakeX: no AVX-512 here, skipped"; continue; fi; \
		echo "OPENBLAS_CORETYPE=$$core"; \
		OPENBLAS_CORETYPE=$$core $(PY) -m pytest $(NUMERICAL) -k "$(NOT_FLOWN)" || exit 1; \
	done
	NUMBA_CPU_NAME=generic NUMBA_CACHE_DIR=$(VENV)/numba-generic $(PY) -m pytest $(COMPILED)

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
