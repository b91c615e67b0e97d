# Every target builds .venv by itself on a machine that has Python >= 3.11 and nothing else.
PYTHON ?= python3
# The official index of CPU builds of PyTorch; set it empty to take whatever your package index offers.
TORCH_INDEX ?= https://download.pytorch.org/whl/cpu
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check

.PHONY: demo test test-docs lint format docs pictures bench properties mutate faults fuzz soak clean

demo: $(VENV)/.base
	$(BIN)/surefoot demo

test: $(VENV)/.dev
	$(BIN)/python -m pytest

# Every command in README and docs that `make test` only parses, because it takes long: about twenty minutes.
test-docs: $(VENV)/.bench
	$(BIN)/python -m pytest tests/documentation/test_documentation_commands.py tests/documentation/long_commands.py

# The property tests of the controller with a hundred times as many examples: about ten minutes.
properties: $(VENV)/.dev
	SUREFOOT_EXAMPLES=100 $(BIN)/python -m pytest tests/controller/test_controller_properties.py \
	  tests/controller/test_controller_energy.py --timeout=3600 --hypothesis-show-statistics

# Changes the safety gate in every way and asks its tests whether they notice: about ten minutes.
mutate: $(VENV)/.mutate
	$(BIN)/python tests/controller/mutate_gate.py

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy examples

format: $(VENV)/.dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# The site, in site/: opens from there without a server, and fetches nothing from elsewhere.
docs: $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet
	$(BIN)/python docs/generate/outside.py site
	@echo "site/index.html"

# The pictures of docs/concepts.md, drawn by the code they explain.
pictures: $(VENV)/.base
	$(BIN)/python docs/pictures --out docs/images

bench: $(VENV)/.bench
	$(BIN)/python -m benchmarks.mpc --json runs/bench/mpc.json
	$(BIN)/python -m benchmarks.anticipation --json runs/bench/anticipation.json
	$(BIN)/python -m benchmarks.wire --json runs/bench/wire.json
	$(BIN)/surefoot latency --json runs/bench/latency.json
	$(BIN)/python -m benchmarks.loop --json runs/bench/loop.json

# Real processes, faults x streams: about six minutes on an idle machine; writes the table of docs/safety.md.
faults: $(VENV)/.dev
	$(BIN)/python -m benchmarks.faults

# A million mutated payloads for each decoder: about fifteen minutes on one core.
fuzz: $(VENV)/.dev
	$(BIN)/python -m benchmarks.fuzz --json runs/fuzz.json

# Half an hour of the whole system at ten times the usual rates.
soak: $(VENV)/.dev
	$(BIN)/python -m benchmarks.soak --json runs/soak.json

clean:
	rm -rf $(VENV) runs build site *.egg-info

# torch goes first and alone: a CPU build sorts above the plain release of the same number, so it is taken
# wherever one is offered, and nothing that follows pulls CUDA. The index is asked once, briefly, because pip
# itself would retry an unreachable one for minutes.
$(VENV)/.base: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "surefoot needs Python >= 3.11; $(PYTHON) is $$($(PYTHON) -V 2>&1). Try: make PYTHON=python3.11" >&2; exit 2; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@index=""; \
	if [ -n "$(TORCH_INDEX)" ] && $(PYTHON) -c 'import sys, urllib.request; urllib.request.urlopen(sys.argv[1], timeout=5)' \
	  "$(TORCH_INDEX)/torch/" >/dev/null 2>&1; then index="--extra-index-url $(TORCH_INDEX)"; fi; \
	echo "installing PyTorch (CPU build where offered)"; \
	$(PIP) install --quiet -c constraints.txt $$index torch==2.13.0
	@echo "installing Surefoot and its dependencies"
	@$(PIP) install --quiet -c constraints.txt -e .
	@touch $@

$(VENV)/.dev: $(VENV)/.base
	@echo "installing what tests and lint need"
	@$(PIP) install --quiet -c constraints.txt -e '.[dev]'
	@touch $@

$(VENV)/.docs: $(VENV)/.base
	@echo "installing what builds the site"
	@$(PIP) install --quiet -c constraints.txt -e '.[docs]'
	@touch $@

$(VENV)/.mutate: $(VENV)/.dev
	@echo "installing what mutates and what counts covered branches"
	@$(PIP) install --quiet -c constraints.txt -e '.[dev,mutate]'
	@touch $@

$(VENV)/.bench: $(VENV)/.dev
	@echo "installing the solvers that the benchmark compares with"
	@$(PIP) install --quiet -c constraints.txt -e '.[dev,bench]'
	@touch $@
