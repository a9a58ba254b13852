"""Makes docs/concave.png: the recording that examples/chain_links.py writes, as Chromium shows it.

python docs/concave.py
"""

import subprocess
import sys
import tempfile
from pathlib import Path

from photograph import ROOT, photograph


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, ROOT / "examples" / "chain_links.py"], cwd=folder, check=True)
        link = Path(folder, "chain_links.html").as_uri()
        photograph(link, ROOT / "docs" / "concave.png")


if __name__ == "__main__":
    main()
