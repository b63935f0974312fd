# Every target sets up what it needs. Another Python: make test PYTHON=python3.12 VENV=.venv312
PYTHON ?= python3
VENV ?= .venv
EXTRAS = ros,fem,plot,progress,web,docs,verify,test,dev
VERSION := $(shell $(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null)
READY = $(VENV)/.ready-$(VERSION)
OTHER = $(filter-out $(READY),$(wildcard $(VENV)/.ready-*))
RUN = $(VENV)/bin/python -m
# One more than there are cores: live nodes mostly wait.
TESTERS := $(shell echo $$(( $$(nproc 2>/dev/null || echo 2) + 1 )))

# ROS nodes of this run neither hear nor disturb those of other machines or other runs.
export ROS_AUTOMATIC_DISCOVERY_RANGE = LOCALHOST
ROS_DOMAIN_ID ?= $(shell echo $$(( $$$$ % 90 + 1 )))
export ROS_DOMAIN_ID

# Containers set it: then each of a hundred nodes and commands of the tests compiles all modules.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help demo test lint docs bench tables clean

help:
	@echo "make demo    correct a virtual wrist live, then find a hidden fault; see demo/demo.png"
	@echo "make test    run all tests"
	@echo "make lint    ruff and mypy"
	@echo "make docs    the documents as a site; open site/index.html"
	@echo "make bench   measure speed, some twenty minutes; see bench-results/speed.md"
	@echo "make tables  compute the shipped tables again from their geometry"
	@echo "make clean   remove what make made, the virtual environment included"
	@echo "Each sets itself up in VENV=$(VENV) with PYTHON=$(PYTHON) (3.11 or 3.12)."

demo: $(READY)
	$(VENV)/bin/python bench/demo/demo.py -o demo

# Who is done takes over from others.
test: $(READY)
	$(RUN) pytest -n $(TESTERS) --dist worksteal $(PYTEST_ARGS) test

lint: $(READY)
	$(RUN) ruff check .
	$(RUN) ruff format --check .
	$(RUN) mypy

docs: $(READY)
	NO_MKDOCS_2_WARNING=1 $(RUN) mkdocs build

bench: $(READY)
	$(VENV)/bin/python bench/page.py $(BENCH_ARGS)

tables: $(READY)
	$(RUN) wrist_stiffness table build config/palmieri2015.yaml -o precomputed/palmieri2015.npz

clean:
	rm -rf $(VENV) demo site build install log *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find wrist_stiffness test -name __pycache__ -prune -exec rm -rf {} +

$(READY): setup.py constraints.txt $(wildcard wrist_stiffness/*/native/*)
	@echo "$(VERSION)" | grep -qx '3\.1[12]' || \
	  { echo "error: $(PYTHON) is not Python 3.11 or 3.12; use make PYTHON=python3.11" >&2; exit 1; }
	$(PYTHON) -m venv $(if $(OTHER),--clear) $(VENV)
	$(RUN) pip install --quiet --disable-pip-version-check -c constraints.txt setuptools
	$(RUN) pip install --quiet --disable-pip-version-check -c constraints.txt \
	  --no-build-isolation -e '.[$(EXTRAS)]'
	@touch $(READY)
