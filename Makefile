# The two commands are `make demo` and `make test`. Each needs Python 3.10 to 3.13 and nothing
# else: it creates .venv when it is missing and installs into it from PyPI. In a shell where
# ROS 2 Jazzy is sourced, .venv uses the rclpy, numpy and scipy that are there instead.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

# Nothing speaks beyond this host.
export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
unexport ROS_STATIC_PEERS

ROS_IS_SOURCED := $(shell [ "$$ROS_DISTRO" = jazzy ] && $(PYTHON) -c 'import rclpy' 2>/dev/null \
	&& echo true || echo false)
ifeq ($(ROS_IS_SOURCED),true)
VENV_OPTIONS := --system-site-packages
EXTRAS := test
else
VENV_OPTIONS :=
EXTRAS := ros,test
# Another ROS that is sourced must not shadow the wheels.
ifdef ROS_DISTRO
unexport ROS_DISTRO AMENT_PREFIX_PATH LD_LIBRARY_PATH PYTHONPATH RMW_IMPLEMENTATION
endif
endif

# Made last: an installation that was interrupted has none. There is one for each kind of ROS.
INSTALLED := $(VENV)/installed.ros-is-sourced.$(ROS_IS_SOURCED)
# Stands while an installation is under way.
UNFINISHED := $(VENV)/unfinished
SOURCES := Makefile setup.py setup.cfg pyproject.toml package.xml \
	$(shell find resource config launch msgs_spec -type f ! -name '*.pyc')

define CHECK_PYTHON
import sys
if not (3, 10) <= sys.version_info[:2] <= (3, 13):
    sys.exit("shimmy_ros needs Python 3.10 to 3.13, but $(PYTHON) is %d.%d: name another, "
             "for example PYTHON=python3.12 on the command line of make." % sys.version_info[:2])
endef
export CHECK_PYTHON

define NUMPY_IS_TYPED
import sys, numpy
sys.exit(tuple(map(int, numpy.__version__.split(".")[:2])) < (2, 4))
endef
export NUMPY_IS_TYPED

.PHONY: help demo test bench lint clean

help:
	@echo 'make demo   play a real landing to predictor and simulator; results in out/'
	@echo 'make test   lint and run all tests'
	@echo 'make bench  measure; figures and ratios into out/bench.json'
	@echo 'make lint   ruff and mypy alone'
	@echo 'make clean  remove .venv, out/ and everything else that was generated'
	@echo 'Another Python than python3: PYTHON=python3.12 (at the first installation)'

demo: $(INSTALLED)
	$(BIN)/shimmy demo

test: lint
	$(BIN)/python -m pytest

# Single-threaded BLAS; the figures go to out/bench.json.
bench: $(INSTALLED)
	$(BIN)/python -m benchmarks

lint: $(INSTALLED)
	$(BIN)/python -m ruff check
	@if $(BIN)/python -c "$$NUMPY_IS_TYPED"; then echo '$(BIN)/python -m mypy'; \
		$(BIN)/python -m mypy; else echo 'mypy is left out: it needs numpy 2.4 or newer,' \
		'whose own annotations are complete'; fi

# A .venv that is unfinished, without pip, or made for the other kind of ROS is made anew;
# any other is kept and only brought up to date.
$(INSTALLED): $(SOURCES)
	@command -v $(PYTHON) >/dev/null || { echo 'shimmy_ros needs Python 3.10 to 3.13, but there' \
		'is no $(PYTHON): name one, for example PYTHON=python3.12 on the command line of make.' \
		>&2; exit 1; }
	@$(PYTHON) -c "$$CHECK_PYTHON"
	@if [ -e $(UNFINISHED) ] || ! $(BIN)/python -m pip --version >/dev/null 2>&1 || \
		! grep -q 'include-system-site-packages = $(ROS_IS_SOURCED)' $(VENV)/pyvenv.cfg; then \
		rm -f $(VENV)/pyvenv.cfg && rm -rf $(VENV) && mkdir $(VENV) && touch $(UNFINISHED) && \
		$(PYTHON) -m venv $(VENV_OPTIONS) $(VENV); fi
	@touch $(UNFINISHED)
	@echo 'Installing into $(VENV) (about a minute the first time) ...'
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[$(EXTRAS)]'
	@echo 'Compiling the solver (once) ...'
	@for velocity in 40 7; do $(BIN)/shimmy predict --velocity $$velocity >/dev/null; done
	@rm $(UNFINISHED)
	@touch $@

clean:
	rm -rf $(VENV) out build install log dist *.egg-info .hypothesis .mypy_cache .pytest_cache \
		.ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
