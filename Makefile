VENV := .venv
PYTHON ?= python3
INSTALLED := $(VENV)/.installed
DEVELOPED := $(VENV)/.developed
PIP := PYTHONWARNINGS='ignore:Editable installation' $(VENV)/bin/pip install --quiet --disable-pip-version-check --no-compile
PARALLEL := --numprocesses auto --dist worksteal
THREADS := 'tests/verification/test_any_company.py::test_threads_and_chunks_change_no_bit[2-0.0-single]'
ELEMENTS := tests/verification/test_continuum.py

export PYTHONDONTWRITEBYTECODE :=

.PHONY: demo gallery docs test types suite lowest benchmark clean

demo: $(INSTALLED)
	$(VENV)/bin/warpimpact run campaigns/fitted_plate.toml -o slotted.nc --overwrite
	$(VENV)/bin/warpimpact plot slotted.nc --overwrite
	$(VENV)/bin/warpimpact validate slotted.nc

gallery: $(DEVELOPED)
	$(VENV)/bin/python campaigns/gallery.py
	$(VENV)/bin/python tests/benchmarks/design_page.py film

# Figures of docs/benchmarks.md; on a quiet machine, some 8 minutes on two cores.
benchmark: $(DEVELOPED)
	$(VENV)/bin/python tests/benchmarks/page.py
	$(VENV)/bin/python tests/benchmarks/law_error.py

# Pages in build/docs/index.html; tutorials are executed. A warning is an error. The tests check the examples in pages.
docs: $(DEVELOPED)
	$(VENV)/bin/sphinx-build -q -W --keep-going -j auto -b html -d build/doctrees docs build/docs

# The kernel tests, the elements of the continuum and one run on several threads are repeated in Warp's debug mode, which
# checks array bounds. Types are checked beside the tests, as that takes one core only.
test: $(DEVELOPED)
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(MAKE) --no-print-directory --jobs=2 types suite
	$(VENV)/bin/pytest $(PARALLEL) tests/kernels $(ELEMENTS) $(THREADS) --warp-mode debug

types: $(DEVELOPED)
	$(VENV)/bin/mypy

suite: $(DEVELOPED)
	$(VENV)/bin/pytest $(PARALLEL) --durations=40

# A fast part of the suite with the lowest versions that pyproject.toml allows, in an environment of its own.
lowest:
	$(PYTHON) tests/lowest_versions.py

clean:
	rm -rf $(VENV) build slotted.nc slotted.nc.parts slotted_*.png

# Editable, so that the modules of kernels/ and campaigns/ are found inside the package from the checkout, too. Its
# finder serves the interpreter only; type checkers find the package by the path in warpimpact.pth. Bytecode is written
# where a module is first imported, whatever the environment says: that of all 15,000 modules takes 45 s of a core, and
# most are never imported.
$(INSTALLED): pyproject.toml Makefile
	@echo "installing warpimpact into $(VENV): a minute, and the time that downloads take"
	@$(PYTHON) -m venv $(VENV)
	@$(PIP) --editable .
	@echo "$(CURDIR)" > "$$($(VENV)/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/warpimpact.pth"
	@touch $@

# What tests, documentation and figures need beside it.
$(DEVELOPED): $(INSTALLED)
	$(PIP) --editable '.[dev]'
	touch $@
