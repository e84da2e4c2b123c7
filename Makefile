# Two commands do all the set-up on a fresh machine: `make demo` and `make test`.
PYTHON ?= python3
BIN := .venv/bin
COMPUTED := $(addprefix tests/,effects estimator hidden_effects learner measured)

.PHONY: install demo test test-fast test-vcan check bench campaign faults lock clean

install: .venv/installed

.venv/installed: requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit("Étude needs Python 3.11 or newer; this is " + sys.version.split()[0] + ": set PYTHON=python3.x") if sys.version_info < (3, 11) else 0'
	$(PYTHON) -m venv .venv || { echo "python3 -m venv failed: on Debian or Ubuntu, apt-get install python3-venv" >&2; exit 1; }
	$(BIN)/pip install --quiet --require-hashes -r requirements.lock
	$(BIN)/pip install --quiet --no-deps --no-build-isolation -e .
	@touch $@

demo: install  ## the main job on the stand-in arm
	$(BIN)/etude demo

test: test-fast test-vcan  ## every test, on the local bus and on SocketCAN

test-fast: install  ## side by side what only computes, then one by one what runs processes and meets clocks
	$(BIN)/pytest -n 2 --dist loadfile $(COMPUTED)
	$(BIN)/pytest -m "not vcan" $(addprefix --ignore=,$(COMPUTED))

test-vcan: install  ## the integration tests on real SocketCAN: this kernel's, else a guest's
	tests/vcan/run

check: install  ## formatting, lint, types, import directions
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: install  ## every performance figure, beside its reference
	$(BIN)/python -m benchmarks

campaign: install  ## the hidden-effect campaign: how often the diagnosis is right, wrong, silent
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m benchmarks.campaign

faults: install  ## inject every fault, print what was seen of it; SOCKETCAN=1: on SocketCAN too
	$(BIN)/python -m tests.faults
	$(if $(SOCKETCAN),tests/vcan/guest --timeout 3600 --interfaces "vcan0 vcan1 vcan2" -- $(BIN)/python -m tests.faults --socketcan)
	ETUDE_FAULTS=full $(BIN)/pytest -q -s tests/faults/test_spoilt_streams.py tests/faults/test_random_commands.py \
		tests/faults/test_killed_sessions.py tests/faults/test_long_run.py tests/driver/test_killed_while_writing.py tests/service/test_strangers.py

lock:  ## resolve the dependencies again
	$(PYTHON) -m venv .venv/lock && .venv/lock/bin/pip install --quiet uv
	.venv/lock/bin/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header --no-emit-index-url --no-annotate --group dev pyproject.toml -o requirements.lock

clean:
	rm -rf .venv build etude-demo *.egg-info
