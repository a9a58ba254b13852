"""Makes docs/picture.png, the README's picture: the recording of the Franka scene as Chromium shows it near the end.

python docs/picture.py
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

TIME = 1.24  # seconds: the duck is lifted, the squeeze deepest
CAMERA = "from=0.765,-0.125,0.235&at=0.55,0,0.2"
HERE = Path(__file__).parent


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder, "franka_grasp.html")
        scene = HERE.parent / "scenes" / "franka_grasp.py"
        subprocess.run([sys.executable, "-m", "overlapper", "run", str(scene), "--html", str(page)], check=True)
        screenshot(f"{page.as_uri()}#t={TIME}&{CAMERA}", HERE / "picture.png")


def screenshot(link: str, picture: Path) -> None:
    """What Chromium shows of a recording, as a PNG of 1920 x 1200."""
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if chromium is None:
        sys.exit("the pictures of the documentation need Chromium: apt-get install chromium")
    options = ["--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--no-first-run"]
    options += ["--enable-unsafe-swiftshader", "--disable-background-networking", "--virtual-time-budget=4000"]
    options += ["--window-size=1200,750", "--force-device-scale-factor=1.6", f"--screenshot={picture}"]
    with tempfile.TemporaryDirectory() as profile:
        subprocess.run([chromium, *options, f"--user-data-dir={profile}", link], check=True, capture_output=True)
    print(picture)


if __name__ == "__main__":
    main()
