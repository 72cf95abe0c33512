# make demo · make test · make check · make bench · make results          (make help explains)

PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/installed
TOOLS := $(VENV)/tools
COMPILED := $(VENV)/compiled
COLLECTED := $(VENV)/collected
KERNELS := $(shell find service/dropanchor_service/estimation service/dropanchor_service/zones service/dropanchor_service/*/kernels -name '*.py')
# Of the thousands of modules Python compiles itself what it imports; pip would compile them all, for half of its time.
INSTALL := install --quiet --no-compile --constraint constraints.txt
DISTRIBUTIONS := -e schemas -e 'tag_client[calibrate,mqtt,serial]' -e service/evaluation -e 'service[cluster,evaluation,foxglove,maps,mqtt,parquet,postgresql,ros2,s3]'
TOOLS_TOO := --group dev -e 'tag_client[imu]' -e 'service[recordings]'
FAILED := echo 'The installation failed; the lines above say why. Mend that, then run the same make command again.' >&2; exit 1
PACKAGES := schemas/dropanchor_schemas tag_client/dropanchor_tag_client service/dropanchor_service service/evaluation/dropanchor_evaluation
PARALLEL := -n 6 --dist loadfile --no-loadscope-reorder
PYPROJECTS := pyproject.toml constraints.txt schemas/pyproject.toml tag_client/pyproject.toml service/pyproject.toml service/evaluation/pyproject.toml

FAST_TESTS := -n 3 --dist worksteal -m 'not benchmark and not cluster and not installation and not outside and not long'

RESULTS := service/docs/results

.PHONY: help demo docs pythons system-python would-install test test-cluster check bench results pictures install kernels chromium mosquitto proxies postgresql clean
.DEFAULT_GOAL := help

# The same as in tests/conftest.py, from the first import on.
unexport PYTHONDONTWRITEBYTECODE

help:
	@echo 'make demo     start the service and simulated tags around one anchor, print the page address'
	@echo 'make test     install what the tests need and run them all'
	@echo 'make test FAST=1   the short ones that need no browser, no other process and no database'
	@echo 'make check    format, lint, types, import rules, generated files, breaking changes, edited results'
	@echo 'make docs     the documentation as a site of static files, in build/docs; the service has it below /help'
	@echo 'make bench    measure what the service costs, print it and write it into $(RESULTS)/performance.md'
	@echo 'make test-cluster  upgrade a cluster, let each of its parts die, and write the silences into $(RESULTS)/cluster.md'
	@echo 'make dist     build the release, twice, and see that it comes out the same; make test-dist installs it'
	@echo 'make results  measure everything in $(RESULTS) again: hours, on a machine that does nothing else'
	@echo 'make pictures photograph the page for the README, when make check says that the page has changed'
	@echo 'make install  the set-up alone: a virtual environment in $(VENV), and the estimator compiled'

install: $(COMPILED)

$(STAMP): $(PYPROJECTS)
	@test -n '$(PYTHON)' || { echo 'Dropanchor needs Python 3.11 or newer; none was found. Install one, or: make PYTHON=/path/to/python3.11 $(MAKECMDGOALS)' >&2; exit 1; }
	@echo '== making the virtual environment $(VENV) (once)'
	@$(PYTHON) -m venv $(VENV) || { echo 'python -m venv failed. On Debian or Ubuntu: apt-get install python3-venv' >&2; exit 1; }
	@echo '== installing Dropanchor and what it needs (once; afterwards no network is needed)'
	@$(BIN)/python -m pip install --quiet --upgrade 'pip>=25.1'
	@$(BIN)/python -m pip $(INSTALL) $(DISTRIBUTIONS) || { $(FAILED); }
	@touch $@

# Only checks, tests and documents need these.
$(TOOLS): $(STAMP)
	@echo '== installing the tools for checks, tests and documents (once)'
	@$(BIN)/python -m pip $(INSTALL) $(TOOLS_TOO) || { $(FAILED); }
	@touch $@

# Here and not at the first start, which then takes seconds. Tests have a cache of their own.
$(COMPILED): $(STAMP) $(KERNELS)
	@echo '== compiling the estimator (again after each change of it)'
	@$(BIN)/dropanchor compile
	@touch $@

demo: install
	@exec $(BIN)/dropanchor demo $(DEMO)

# That the pins hold for the Pythons that are promised, and that the system's own installs what a user installs.
would-install: $(STAMP)
	@$(BIN)/python -m pip --python $(PYTHON) $(INSTALL) --dry-run $(DISTRIBUTIONS) $(TOOLS_TOO)

pythons: $(STAMP)
	@.ci/pythons

system-python:
	@.ci/system-python

docs: $(TOOLS)
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet --config-file service/mkdocs.yml
	@echo 'The pages are in build/docs: $(BIN)/python -m http.server --bind 127.0.0.1 --directory build/docs'

# They need no tools, which .ci/run installs meanwhile.
kernels: $(STAMP)
	@PYTHONPATH=tests $(BIN)/python -m support.kernel_cache

# Without this each worker compiles all test modules, and several compile the same at a time.
$(COLLECTED): $(TOOLS)
	@if $(BIN)/python -m pytest --collect-only -q >/dev/null; then touch $@; fi

chromium:
	@command -v chromium-headless-shell >/dev/null || { \
		echo '== installing chromium-headless-shell for the browser tests'; \
		apt-get update -qq && apt-get install -y -qq chromium-headless-shell >/dev/null; } || \
		command -v chromium >/dev/null || command -v chromium-browser >/dev/null || { \
		echo 'The browser tests need Chromium: install chromium-headless-shell or chromium and run make test again.' >&2; exit 1; }

mosquitto:
	@command -v mosquitto >/dev/null || test -x /usr/sbin/mosquitto || { \
		echo '== installing mosquitto for the MQTT tests'; \
		apt-get update -qq && apt-get install -y -qq mosquitto >/dev/null; } || \
		echo 'The MQTT tests need the package mosquitto: without it they are skipped.' >&2

# Their own services, which the packages would start, are not needed.
proxies:
	@for program in nginx caddy; do \
		command -v $$program >/dev/null || test -x /usr/sbin/$$program || { \
		package=$$(echo $$program | sed s/nginx/nginx-light/); \
		echo "== installing $$package for the tests behind a proxy"; \
		apt-get update -qq && apt-get install -y -qq $$package >/dev/null && \
		{ ! command -v systemctl >/dev/null || systemctl disable --quiet --now $$program || true; }; } || \
		echo "The tests behind a proxy need $$program: without it they are skipped." >&2; done

# A cluster of Debian's own, which the package would make and start, is not needed.
postgresql:
	@ls /usr/lib/postgresql/*/bin/initdb >/dev/null 2>&1 || command -v initdb >/dev/null || { \
		echo '== installing PostgreSQL for the tests of the history in a database'; \
		mkdir -p /etc/postgresql-common/createcluster.d && \
		echo 'create_main_cluster = false' >/etc/postgresql-common/createcluster.d/dropanchor.conf && \
		apt-get update -qq && apt-get install -y -qq postgresql >/dev/null; } || \
		echo 'The tests with a database need the package postgresql: without it they are skipped.' >&2

test: $(TOOLS) $(if $(FAST),,chromium mosquitto proxies postgresql kernels $(COLLECTED))
	@echo '== running $(if $(FAST),the fast,all) tests'
	@$(BIN)/python -m pytest $(if $(FAST),$(FAST_TESTS),$(PARALLEL)) $(PYTEST)

check: $(TOOLS)
	@$(BIN)/ruff format --check .
	@$(BIN)/ruff check .
	@$(BIN)/mypy $(PACKAGES) tests
	@PYTHONPATH=tests $(BIN)/python -m support.page_types
	@$(BIN)/lint-imports --no-cache
	@$(BIN)/python -m dropanchor_schemas.export --check
	@$(BIN)/python -m dropanchor_service.api.export --check
	@$(BIN)/python -m dropanchor_service.api.compatibility --check
	@$(BIN)/python -m dropanchor_evaluation.reference.export --check
	@$(BIN)/python -m dropanchor_evaluation.results --check
	@PYTHONPATH=tests $(BIN)/python -m pictures --check

bench: $(TOOLS) chromium postgresql
	@$(BIN)/python -m pytest tests/benchmarks -s -m '' $(PYTEST)

test-cluster: $(TOOLS) postgresql
	@$(BIN)/python -m pytest tests/e2e/test_upgrade_on_ray.py tests/benchmarks/test_cluster_failures.py tests/benchmarks/test_cluster_of_hosts.py -s -m '' $(PYTEST)

results: bench
	@$(BIN)/dropanchor evaluate recordings --into $(RESULTS)/recordings.md $(EVALUATE)
	@$(BIN)/dropanchor evaluate paper --into $(RESULTS)/paper.md $(EVALUATE)
	@$(BIN)/dropanchor evaluate product --into $(RESULTS)/scenarios.md $(EVALUATE)
	@$(BIN)/dropanchor evaluate ablate --into $(RESULTS)/ablation.md
	@$(BIN)/dropanchor evaluate bounds --into $(RESULTS)/scenarios.md $(EVALUATE)

pictures: $(TOOLS) chromium
	@PYTHONPATH=tests $(BIN)/python -m pictures

clean:
	rm -rf $(VENV) .pytest_cache .mypy_cache .ruff_cache .hypothesis

.PHONY: dist test-dist

# A release in dist/, built twice to see that it comes out the same: deploy/release/README.md.
dist: $(TOOLS)
	@PYTHONPATH=deploy $(BIN)/python -m release.build dist

# Installs the wheels into an empty environment, compiles the estimator and looks at the page: minutes, and the network.
test-dist: dist
	@$(BIN)/python -m pytest tests/deploy -s -m installation $(PYTEST)
