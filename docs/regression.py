"""Makes docs/regression.png: the page of before and after of a scene of examples/ci whose model has been changed.

python docs/regression.py
"""

import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from photograph import ROOT, browser, save

SECONDS = 20  # for both recordings, which are in frames of their own, to be drawn


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        repository = shutil.copytree(ROOT / "examples" / "ci", Path(folder, "mine"))
        model = repository / "models" / "drawer.urdf"
        model.write_text(model.read_text(encoding="utf-8").replace("0.5 0.396 0.015", "0.5 0.398 0.015"))
        subprocess.run([sys.executable, "-m", "overlapper", "check", "scenes"], cwd=repository)
        with browser(1280, 1000) as window:
            window.open((repository / "out" / "drawer.moved.html").as_uri(), "document.readyState === 'complete'")
            time.sleep(SECONDS)
            save(window, ROOT / "docs" / "regression.png")


if __name__ == "__main__":
    main()
