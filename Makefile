# The whole ceremony: `make demo` shows the bench at work, `make test` proves it.
# Both set up what they need in .venv first.

PYTHON ?= python3.11
ifeq (, $(shell command -v $(PYTHON) 2>/dev/null))
PYTHON := python3
endif
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.set-up
DEMO_STAMP := $(VENV)/.set-up-demo
comma := ,
# One more than two cores: many tests wait for a real clock. With four a run takes as long.
JOBS   ?= 3
# What is built with the package: set up again when it has changed.
COMPILED := $(wildcard bluepill_sim/extension/source/*/*) robot_bench/wires/edges.c $(wildcard robot_bench/direct/differential/*.[ch]) \
    $(shell find adapter_fw/core adapter_fw/capi adapter_fw/esp32/main adapter_fw/esp32_sim -type f)

.PHONY: page page-check setup demo test lint type unit wheels bench bench-history soak steady mutants hostile foreign clean firmware mutation-tools board board-check board-tools pictures site generated

setup: $(STAMP)

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "make: Python 3.11 or newer is needed (hint: make PYTHON=/path/to/python3.11)"; exit 2; }
	@$(PYTHON) -m venv $(VENV) || \
	    { rm -rf $(VENV); echo "make: cannot create a virtual environment (hint: apt-get install python3-venv)"; exit 2; }

# Modules are compiled when they are first imported: to compile all that is installed took 45 s.
# PyBullet has no wheels beyond Python 3.11: there the extra `physics` is MuJoCo, and everything but the `bullet` body works.
define install
@command -v $${CC:-cc} gcc >/dev/null || \
    { echo "make: the emulator needs a C compiler (hint: apt-get install g++ libc6-dev)"; exit 2; }
$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt -e '.[$(1)]'
@touch $@
endef

$(STAMP): pyproject.toml setup.py constraints.txt $(COMPILED) | $(BIN)/python
	$(call install,all$(comma)dev)

# The demo needs little of it, and a project that `p2os new` writes after it needs pytest; what else a verb wants, it says.
$(DEMO_STAMP): pyproject.toml setup.py constraints.txt $(COMPILED) | $(BIN)/python
	$(call install,sim$(comma)physics$(comma)test)

demo: $(if $(wildcard $(STAMP)),$(STAMP),$(DEMO_STAMP))
	@$(BIN)/p2os demo; status=$$?; \
	    echo; echo "type next:  . $(BIN)/activate    (p2os is then on your PATH in this terminal)"; \
	    echo "then:       p2os doctor"; exit $$status

# All of it, the type check while tests wait; with HOUSE=p2os the tests and pages of one house, nothing else being there.
ifdef HOUSE
test: setup
	$(BIN)/python -m tools.packaging.testing $(HOUSE)
else
test: lint
	$(MAKE) --no-print-directory -j2 type unit
endif

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

type: setup
	$(BIN)/mypy

# One run for all; how lines are counted says tests/tools/counted_lines.py.
unit: setup
	rm -rf .coverage
	$(BIN)/pytest -n $(JOBS) -m 'not soak and not hardware' --count-lines .coverage
	$(BIN)/python -m tools.check_coverage .coverage

bench: setup
	$(BIN)/python tools/bench/emulator.py
	$(BIN)/python tools/bench/loops.py
	$(BIN)/python tools/bench/columns.py
	$(BIN)/python tools/bench/captures.py
	$(BIN)/python tools/bench/bodies.py
	$(BIN)/python tools/bench/pioneer.py
	$(BIN)/python tools/bench/speed.py
	$(BIN)/python tools/bench/shares.py
	$(BIN)/python tools/bench/costs.py
	$(BIN)/python tools/bench/devices.py
	$(BIN)/python tools/bench/beginners.py
	$(BIN)/python tools/bench/shares.py --timers
	$(BIN)/python tools/bench/devices.py --timers

# The figures beside those of earlier commits: build/bench/history.md.
bench-history: setup
	@mkdir -p build/bench
	$(MAKE) --no-print-directory bench > build/bench/latest.txt
	$(BIN)/python -m tools.bench_history build/bench

# A source distribution and a wheel of each house, in dist/; FOR=all or FOR=musllinux_1_2_aarch64 for other machines than this one.
wheels: setup
	@$(if $(FOR),$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt -e '.[wheels]')
	$(BIN)/python -m tools.packaging $(if $(FOR),--for $(FOR))

soak: setup mutation-tools
	$(BIN)/pytest -n $(JOBS) -m '(soak or hypothesis) and not hardware' --hypothesis-profile drawn
	$(BIN)/python -m tools.mutants --sample whole

# The tests that read a real clock, twenty times on a machine that is busy; STEADY="--times 3 tests/p2os/client" fewer of them.
steady: setup
	@$(BIN)/python -m tests.tools.suite.steady $(STEADY)

# Changes the code in one place at a time and runs the nearest tests: of the lines that differ from a commit (SINCE=main), of files or folders
# (FILES="p2os/client" COUNT=60 SEED=1), a sample with its floor (SAMPLE=ci), or faults that were put down (FILES=--planted); NOTE=1 adds what survives to tools/mutants/survivors.toml.
mutants: setup
	@$(BIN)/python -m tools.mutants $(FILES) $(if $(SINCE),--since $(SINCE)) $(if $(SAMPLE),--sample $(SAMPLE)) \
	    $(if $(COUNT),--count $(COUNT)) $(if $(SEED),--seed $(SEED)) $(if $(NOTE),--note)

# Attacks every socket of every verb while wheels are watched, eleven minutes; ON="serve sniff --attack flood" some of it.
hostile: setup
	@$(BIN)/python -m tools.hostile $(ON)

# The programs of others that are in a cache outside the checkout (docs/foreign.md): all, or ROWS=klippy-usb,grbl-usart, or ROWS=client.
foreign: setup
	@$(BIN)/python -m tools.foreign $(ROWS)

# What changes the adapter's two sides in `make soak`, an ESP32 that runs its core, and fuzzing that is guided by coverage. Without universalmutator's own wishes: one of them is a copy of
# `typing` that shadows Python's.
mutation-tools: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'cosmic-ray==8.7.0' 'labwired==0.25.0'
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'atheris==3.0.0; python_version < "3.12"'
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps 'universalmutator==1.14.1'

# Rebuilds the example firmware (needs gcc-arm-none-eabi); `make test` compares.
firmware: setup
	$(BIN)/python robot_bench/firmware/build.py

# The adapter board: `make board` writes every file anew from the design, then checks them; `make board-check` only
# checks. KiCad 9 and ngspice are installed where apt and root allow it; what is missing is skipped aloud, or fails
# with BOARD_CHECK=--strict.
board: board-tools
	$(BIN)/python -m hardware.pcb build
	$(BIN)/python -m hardware.pcb simulate
	$(BIN)/python -m hardware.pcb check
	$(BIN)/python -m tools.pictures

board-check: board-tools
	$(BIN)/python -m hardware.pcb check $(BOARD_CHECK)

board-tools: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt -e '.[board]'
	tools/install_board_tools.sh

# Every picture of docs/ whose inputs have changed, made anew; `make test` names those that are out of date.
pictures: board-tools
	$(BIN)/python -m tools.pictures

# Every committed file that is made of a declaration (C headers, tables of pages), made anew; `make test` names those that are stale.
generated: setup
	@for tool in tools/generators/*.py; do $(BIN)/python -m tools.generators.$$(basename $$tool .py) || exit; done

# The page of a run (p2os/view/bundle), from its TypeScript; needs Node 20 or newer, and what package-lock.json names.
page:
	@command -v npm >/dev/null || { echo "make: the page is built with Node 20 or newer (hint: apt-get install npm)"; exit 2; }
	cd tools/page && npm ci --silent --no-audit --ignore-scripts && npm run --silent build
	$(BIN)/python -m tools.generators.browser_chip

# Whether the committed page is what is built, byte for byte, and its checks and tests; skipped aloud without Node.
page-check:
	@if command -v npm >/dev/null; then cd tools/page && npm ci --silent --no-audit --ignore-scripts && npm run --silent check; \
	    else echo "make: no Node: the page is not built and compared"; fi

# The site (docs/, and pages that are generated) in build/site, strictly: what leads nowhere is an error. Nothing is fetched but Zensical, once.
site: setup
	@$(BIN)/python -c 'import zensical' 2>/dev/null || \
	    $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt -e '.[site]'
	$(BIN)/python -m tools.website

clean:
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .coverage .coverage.* runs
	find . -name __pycache__ -prune -exec rm -rf {} +
