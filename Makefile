# `make run` shows what the project does, `make test` proves it; both make their own environment first.

VENV := .venv
SCENE := franka_grasp
FUZZ := -max_total_time=60
NATIVE := $(shell find overlapper/native -type f -not -path '*/corpus/*')

.PHONY: run test fuzz lint format clean

run: $(VENV)/all
	@$(VENV)/bin/overlapper run $(SCENE) --out out/$(SCENE).csv --html out/$(SCENE).html

test: $(VENV)/dev
	@$(VENV)/bin/pytest --numprocesses=auto

# Inputs that reach something new stay in build/fuzz/corpus; one that breaks something is left beside it, by name.
fuzz: build/fuzz/fuzz_overlap
	@mkdir -p build/fuzz/corpus
	@build/fuzz/fuzz_overlap $(FUZZ) -timeout=20 -max_len=600 -len_control=0 -print_final_stats=1 \
	  -verbosity=0 -artifact_prefix=build/fuzz/ build/fuzz/corpus overlapper/native/fuzz/corpus

build/fuzz/fuzz_overlap: $(NATIVE)
	@cmake -S overlapper/native -B build/fuzz -DCMAKE_CXX_COMPILER=clang++ -DOVERLAPPER_FUZZ=ON \
	  -DOVERLAPPER_WERROR=ON --log-level=WARNING
	@cmake --build build/fuzz --parallel $$(getconf _NPROCESSORS_ONLN)

lint: $(VENV)/dev
	@$(VENV)/bin/ruff check
	@$(VENV)/bin/ruff format --check
	@$(VENV)/bin/mypy overlapper
	@$(VENV)/bin/clang-format --dry-run -Werror $(filter %.h %.cpp,$(NATIVE))

format: $(VENV)/dev
	@$(VENV)/bin/ruff format --quiet
	@$(VENV)/bin/clang-format -i $(filter %.h %.cpp,$(NATIVE))

clean:
	@rm -rf $(VENV) build out

# The stamps stand for the package with the extra they are named after; `dev` includes `all`. The installation is
# editable, so only the native sources need another one.
$(VENV)/all $(VENV)/dev: pyproject.toml $(NATIVE) | $(VENV)/bin/python
	@echo "Building overlapper and installing it with the extra '$(@F)' (a few minutes the first time)"
	@$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[$(@F)]'
	@touch $@ $(VENV)/all

# Every Python on PATH is asked, as the first may be a pyenv shim that does not run.
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
