# The two commands of the README are `make run` and `make test`; everything happens in .venv, nothing outside.
PYTHON ?= python3
BIN := .venv/bin
RUN_ARGS ?=

# Many tests start Python anew; where it may not keep what it compiled, as images of containers say, each takes 1 to 3 s
# more.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: help run test test-cluster test-oldest coverage licences golden lint bench pictures networks clean
.DEFAULT_GOAL := help

help:
	@echo "make run    set up, then drive the default co-simulation (RUN_ARGS='dense --seed 3' to vary it)"
	@echo "make test   set up, then run the tests"
	@echo "make test-cluster  a study on a Dask cluster of real processes on this machine"
	@echo "make test-oldest  the tests with the oldest dependencies that pyproject.toml allows, in .venv-oldest"
	@echo "make coverage  the tests, and which lines of the package they run; fails below 90 %"
	@echo "make licences  what the dependencies are licensed under"
	@echo "make networks  make the networks of sumo_net/ anew from their plain XML, with netconvert"
	@echo "make golden renew the numbers that the tests hold runs to; a new line in CHANGELOG.md has to say why"
	@echo "make lint   ruff and mypy"
	@echo "make bench  the benchmarks, measured against the peers in the same run"
	@echo "make clean  remove the virtual environment and caches (tables and runs stay)"

run: .venv/.run-ready
	@$(BIN)/hj-cosim run $(RUN_ARGS)

test: .venv/.test-ready
	@$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder --durations=5 --durations-min=20

test-cluster: .venv/.test-ready
	@$(BIN)/python -m pytest tests/study/cluster

coverage: .venv/.coverage-ready
	@$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder --cov --cov-report term

licences: .venv/.test-ready
	@$(BIN)/pip-licenses --from mixed --format markdown --order license --ignore-packages hj-cosim \
	  | grep '^|[- ][^ ]'  # some state their whole licence

# Numba's cached kernels are those of one numba: the oldest one has a folder of its own for them. What a wheel needs is
# installed anew by its own test, in the newest versions.
test-oldest: .venv-oldest/.ready
	@NUMBA_CACHE_DIR=$(CURDIR)/.venv-oldest/numba .venv-oldest/bin/python -m pytest -n 2 --dist loadfile \
	  --no-loadscope-reorder --ignore=tests/benchmarks --ignore=tests/study/cluster --ignore=tests/test_wheel.py

.venv-oldest/.ready: pyproject.toml tests/oldest.txt .venv/.uv-ready
	@test -x .venv-oldest/bin/python || $(PYTHON) -m venv .venv-oldest
	@$(BIN)/uv pip install --quiet --python .venv-oldest/bin/python --constraint tests/oldest.txt --editable '.[test]'
	@touch $@

# Renews tests/oldest.txt from the lower bounds in pyproject.toml.
.PHONY: oldest
oldest: .venv/.uv-ready
	@$(BIN)/uv pip compile pyproject.toml --extra test --resolution lowest-direct --python-version 3.11 \
	  --no-header --no-annotate --quiet --output-file tests/oldest.txt

golden: .venv/.test-ready
	@$(BIN)/python tests/golden_runs.py

lint: .venv/.test-ready
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy

bench: .venv/.bench-ready
	@$(BIN)/python -m pytest tests/benchmarks -p no:xdist -s --benchmark-columns=median,iqr,rounds

# The README's pictures, from a run of their own.
pictures: .venv/.run-ready
	rm -rf runs/pictures/run runs/pictures/short
	$(BIN)/hj-cosim run --seed 2 --out runs/pictures/run
	mv runs/pictures/run/figures/*.png runs/pictures/
	$(BIN)/hj-cosim run dense --duration 8 --seed 2 --out runs/pictures/short
	$(BIN)/hj-cosim replay runs/pictures/short --out runs/pictures/replay.gif
	$(BIN)/hj-cosim figure value-slice --out runs/pictures/value-slice.png
	$(BIN)/hj-cosim figure planner-comparison --out runs/pictures/planner-comparison.png
	rm -rf runs/pictures/run runs/pictures/short

# Networks from the plain XML in sumo_net/plain/. netconvert writes the day and its options ahead; that is cut off.
NETWORKS := $(patsubst sumo_net/plain/%.nod.xml,%,$(wildcard sumo_net/plain/*.nod.xml))
networks: .venv/.networks-ready
	@for name in $(NETWORKS); do \
	  plain=sumo_net/plain/$$name; connections=; \
	  test -f $$plain.con.xml && connections="--connection-files $$plain.con.xml"; \
	  $(BIN)/netconvert --node-files $$plain.nod.xml --edge-files $$plain.edg.xml $$connections \
	    --offset.disable-normalization true --no-turnarounds true --xml-validation never \
	    --output-file sumo_net/$$name.net.xml && \
	  sed -i.bak '/^<!-- generated on/,/^-->/d' sumo_net/$$name.net.xml && rm sumo_net/$$name.net.xml.bak || exit 1; \
	done

clean:
	rm -rf .venv .venv-oldest .pytest_cache .mypy_cache .ruff_cache
	find hj_cosim tests -name __pycache__ -type d -prune -exec rm -rf {} +

# uv trusts the machine's certificates, as pip does: it works behind a company's proxy, too.
export UV_SYSTEM_CERTS := 1

# One stamp a set of extras: a second call installs nothing. uv installs in seconds what pip needs two minutes for;
# where uv cannot reach the index, pip does the same work.
define install
	@echo "installing $(1) (once)..."
	@$(BIN)/uv pip install --quiet --python $(BIN)/python --constraint constraints.txt --editable '$(1)' \
	  || { echo "uv could not; pip takes over, which needs a few minutes"; \
	       $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '$(1)'; }
	@touch $@
endef

.venv/.uv-ready: constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed: make PYTHON=python3.11 ...")'
	@test -x $(BIN)/python || $(PYTHON) -m venv .venv
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --constraint constraints.txt uv
	@touch $@

.venv/.run-ready: pyproject.toml constraints.txt .venv/.uv-ready
	$(call install,.)

.venv/.test-ready: pyproject.toml constraints.txt .venv/.uv-ready
	$(call install,.[test])
	@touch .venv/.run-ready

.venv/.coverage-ready: pyproject.toml constraints.txt .venv/.uv-ready
	$(call install,.[coverage])
	@touch .venv/.run-ready .venv/.test-ready

.venv/.networks-ready: pyproject.toml constraints.txt .venv/.uv-ready
	$(call install,.[networks])
	@touch .venv/.run-ready

.venv/.bench-ready: pyproject.toml constraints.txt .venv/.uv-ready
	$(call install,.[bench])
	@touch .venv/.run-ready .venv/.test-ready
