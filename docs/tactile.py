"""Makes docs/tactile.png: the picture that examples/tactile_image.py draws of the pad of a gripper.

python docs/tactile.py
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, ROOT / "examples" / "tactile_image.py"], cwd=folder, check=True)
        shutil.copyfile(Path(folder, "tactile_image.png"), ROOT / "docs" / "tactile.png")


if __name__ == "__main__":
    main()
