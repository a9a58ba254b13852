"""Makes docs/concave.png: the recording that examples/chain_links.py writes, as Chromium shows it.

python docs/concave.py
"""

import subprocess
import sys
import tempfile
from pathlib import Path

from picture import HERE, screenshot

CAMERA = "from=-0.14,-0.36,0.22&at=-0.05,0,0.03"


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, HERE.parent / "examples" / "chain_links.py"], cwd=folder, check=True)
        screenshot(f"{Path(folder, 'chain_links.html').as_uri()}#t=0&{CAMERA}", HERE / "concave.png")


if __name__ == "__main__":
    main()
