"""Makes docs/view.png: the page that `overlapper view franka_grasp` writes, as Chromium shows it.

python docs/view.py
"""

import subprocess
import sys
import tempfile
from pathlib import Path

from photograph import ROOT, photograph

LOOK = "t=1.24&from=0.765,-0.125,0.235&at=0.545,0,0.2&pair=duck.1,panda/panda_rightfinger"


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder, "franka_grasp.html")
        scene = ROOT / "scenes" / "franka_grasp.py"
        subprocess.run([sys.executable, "-m", "overlapper", "view", str(scene), "--html", str(page)], check=True)
        photograph(f"{page.as_uri()}#{LOOK}", ROOT / "docs" / "view.png")


if __name__ == "__main__":
    main()
