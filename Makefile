# Every target sets itself up: a machine with Python 3.11 or newer and make is enough.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.stamp
# Hundreds of processes of the tests would read all sources anew: here Python keeps what it has compiled.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: fly suite test test-all wheel check lint types imports coverage cost measured requirements reference golden pages pictures designs replay digests docs setup clean

fly: setup  ## fly the default scenario: a hardover on one pitch-rate channel of the F-16
	$(BIN)/rig fly

suite: setup  ## fly the bundled scenarios: requirements met, and the same channels failed at the same times by the same rule
	$(BIN)/rig check faults/suites/bundled.toml

test: setup  ## the tests but the long ones, on all cores: about five minutes on two
	$(BIN)/pytest -n auto --dist worksteal -m "not long"

test-all: setup  ## install Chromium, a Vulkan driver, GNAT, Foxglove's packages and Betaflight, run the tests that need them; options=--every: all others too, the long ones among them
	$(BIN)/python tests/tools/outside.py $(options)

wheel: setup  ## sdist and wheel into dist/, and the wheel tried in an environment of its own, outside the checkout
	$(BIN)/python tests/tools/wheel_smoke.py $(options)

check: lint types imports test  ## everything that must hold before a change goes in

lint: setup
	$(BIN)/ruff check rig tests
	$(BIN)/ruff format --check rig tests
	$(BIN)/codespell rig tests docs aircraft faults *.md

types: setup
	$(BIN)/pyright

imports: setup
	$(BIN)/lint-imports

# Flights that take minutes without a compiler, and reach no line that others do not.
FLIGHTS := keeps_every_reference_usable or run_away_together or reads_its_partners or settled_rightly or as_a_reference

coverage: setup  ## statements and branches of the monitor, its kernels interpreted: all of them, or it fails
	NUMBA_DISABLE_JIT=1 $(BIN)/pytest -q -n auto tests/test_redundancy_*.py tests/test_bench_baseline_statistics.py tests/test_analytic_*.py -k "not ($(FLIGHTS))" \
		--cov=rig.computer.redundancy --cov=rig.computer.analytic --cov-branch --cov-report=term-missing --cov-fail-under=100

cost: setup  ## what a frame costs, against bare JSBSim in the same process
	$(BIN)/rig cost

measured: setup  ## write docs/results/measured/: figures of this commit on this machine; only="cost evidence" for some of them
	$(BIN)/python tests/tools/measured.py $(only)

requirements: setup  ## write docs/project/requirements.md from the markers in the tests
	$(BIN)/python tests/tools/requirements.py

pages: setup  ## run all code of README.md and docs/, and put what it prints and draws into the pages; page="docs/x.md" for some of them
	$(BIN)/python tests/tools/pages.py $(page)

reference: setup  ## write the generated pages of docs/reference/: commands, gallery, faults and signals, ICD, Python API
	$(BIN)/python tests/tools/reference_pages.py
	$(BIN)/python tests/tools/cli_page.py

pictures: setup  ## write docs/pictures/: drawings from flights, and photographs of viewer (needs Vulkan) and reports (needs Chromium); only="fault viewer" for some
	$(BIN)/python tests/tools/pictures.py $(only)

golden: setup  ## fly all golden flights and keep what they decide now
	$(BIN)/python tests/tools/golden_flights.py

designs: setup  ## design every bundled aircraft twice: the same bytes both times, and those of its files
	$(BIN)/python tests/tools/design_again.py

replay: setup  ## fly every bundled scenario to its end, replay it and fly it again: all must be identical
	$(BIN)/python tests/tools/replay_all.py

digests: setup  ## fly every bundled scenario in 14 ways and runs of every campaign again: each must have one digest
	$(BIN)/python tests/tools/digests.py
	$(BIN)/python tests/tools/digests.py --campaigns

docs: setup  ## build the docs site into site/: strict, nothing loaded from other hosts
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[docs]'
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo 'site/index.html; with search: python3 -m http.server -b 127.0.0.1 -d site'

setup: $(STAMP)

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit("Python 3.11 or newer is needed, this is " + sys.version.split()[0] if sys.version_info < (3, 11) else 0)'
	$(PYTHON) -m venv $(VENV)
	@echo "installing the packages into $(VENV): two minutes or more, nothing is printed meanwhile"
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test]'
	touch $(STAMP)

clean:
	rm -rf $(VENV) .pytest_cache .ruff_cache .import_linter_cache build dist site
