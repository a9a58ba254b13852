"""Makes docs/meshes.png: the page of the clash among thirty parts; prints the answer, and processor time per command.

python docs/meshes.py
"""

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from photograph import ROOT, photograph  # which also finds what supports the tests

import bearing  # isort: skip


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = folder
        parts, fit, page = (Path(folder, name) for name in ("parts", "fit", "clashes.html"))
        bearing.write(parts)
        bearing.write(fit, off=0)
        print(f"parts that fit: {seconds(fit):.1f} s")
        print(f"with a clash, CoACD asked: {seconds(parts):.1f} s")
        print(f"once more: {seconds(parts):.1f} s")
        print(f"and a page: {seconds(parts, '--html', page):.1f} s")
        photograph(page.as_uri(), ROOT / "docs" / "meshes.png")


def seconds(*arguments: object) -> float:
    """Processor time of the command, with that of CoACD."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "overlapper", "clashes", "--units", "mm", *map(str, arguments)]
    print(subprocess.run(command, capture_output=True, text=True).stdout)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    main()
