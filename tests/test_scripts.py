"""Scripts that make pages are run by hand. A test imports each of them, so that a name that moved is noticed."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = [
    path
    for path in sorted((ROOT / "docs").rglob("*.py"))
    if '__name__ == "__main__"' in path.read_text(encoding="utf-8")
]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: str(script.relative_to(ROOT)))
def test_a_script_finds_what_it_imports(script):
    as_module = f"import sys, runpy; sys.path[0] = {str(script.parent)!r}; runpy.run_path({str(script)!r})"
    run = subprocess.run([sys.executable, "-c", as_module], capture_output=True, text=True)
    # Peers that are measured beside ours need not be installed.
    missing = re.search(r"ModuleNotFoundError: No module named '(\w+)'", run.stderr)
    assert run.returncode == 0 or (missing and not list(ROOT.glob(f"[!.]*/**/{missing[1]}.py"))), run.stderr
