# Every target sets up what it needs. Another Python: make test PYTHON=python3.12 VENV=.venv312
PYTHON ?= python3
VENV ?= .venv
EXTRAS = ros,fem,plot,verify,test,dev
READY = $(VENV)/.ready
RUN = $(VENV)/bin/python -m
TESTERS := $(shell nproc 2>/dev/null || echo 2)

# ROS nodes of this run neither hear nor disturb those of other machines or other runs.
export ROS_AUTOMATIC_DISCOVERY_RANGE = LOCALHOST
ROS_DOMAIN_ID ?= $(shell echo $$(( $$$$ % 90 + 1 )))
export ROS_DOMAIN_ID

.PHONY: help demo test lint tables clean

help:
	@echo "make demo    start the nodes with a virtual cell, record, replay, compare; see demo/"
	@echo "make test    run all tests"
	@echo "make lint    ruff and mypy"
	@echo "make tables  compute the shipped tables again from their geometry"
	@echo "make clean   remove what make made, the virtual environment included"
	@echo "Each sets itself up in $(VENV) with PYTHON=$(PYTHON) (3.11 or 3.12)."

demo: $(READY)
	$(RUN) wrist_stiffness.workflows.demo -o demo

test: $(READY)
	$(RUN) pytest -n $(TESTERS) $(PYTEST_ARGS) test

lint: $(READY)
	$(RUN) ruff check .
	$(RUN) ruff format --check .
	$(RUN) mypy

tables: $(READY)
	$(RUN) wrist_stiffness table build config/palmieri2015.yaml -o precomputed/palmieri2015.npz

clean:
	rm -rf $(VENV) demo build install log *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find wrist_stiffness test -name __pycache__ -prune -exec rm -rf {} +

$(READY): setup.py constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] not in ((3, 11), (3, 12)))' || \
	  { echo "error: $(PYTHON) is not Python 3.11 or 3.12; choose one: make PYTHON=python3.11" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(RUN) pip install --quiet --disable-pip-version-check -c constraints.txt setuptools
	$(RUN) pip install --quiet --disable-pip-version-check -c constraints.txt \
	  --no-build-isolation -e '.[$(EXTRAS)]'
	@touch $(READY)
