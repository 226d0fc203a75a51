# make demo   set up and run the main job
# make test   set up and pass the tests
# make lint   style and types
# make test-environments   the tests once for every number of threads and kind of processor (TESTS="tests/nlp ..." for some)
# make docs   the site in out/docs, warnings and broken links as errors
# make fuzz   an hour of damaged files and command lines (FUZZ_SECONDS=60 make fuzz: a minute)
PYTHON ?= python3
VENV   ?= .venv
OUT    ?= out/demo
FUZZ_SECONDS ?= 3600

.PHONY: demo test test-environments lint docs fuzz setup clean
.DEFAULT_GOAL := demo

setup: $(VENV)/.ready

$(VENV)/.ready: pyproject.toml constraints.txt scripts/set_up.sh
	bash scripts/set_up.sh "$(PYTHON)" "$(VENV)"
	touch $@

demo: setup
	$(VENV)/bin/python scripts/run_demo.py --out $(OUT)

test: setup
	$(VENV)/bin/python -m pytest -n 2 --durations 10

test-environments: setup
	bash scripts/test_environments.sh $(VENV)/bin/python $(TESTS)

lint: setup
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy

docs: setup
	$(VENV)/bin/python -m pip install --quiet --constraint constraints.txt mkdocs-material 'mkdocstrings[python]'
	NO_MKDOCS_2_WARNING=1 $(VENV)/bin/python -m mkdocs build --strict --site-dir out/docs

fuzz: setup
	OMP_NUM_THREADS=1 $(VENV)/bin/python -m tests.fuzz --seconds $(FUZZ_SECONDS)

clean:
	rm -rf $(VENV) out build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
