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
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if chromium is None:
        sys.exit("docs/picture.py needs Chromium: apt-get install chromium")
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder, "recording.html")
        scene = HERE.parent / "scenes" / "franka_grasp.py"
        subprocess.run([sys.executable, "-m", "overlapper", "run", str(scene), "--html", str(page)], check=True)
        options = ["--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--no-first-run"]
        options += ["--enable-unsafe-swiftshader", "--disable-background-networking", "--virtual-time-budget=4000"]
        options += [f"--user-data-dir={folder}/profile", "--window-size=960,600", "--force-device-scale-factor=2"]
        picture = HERE / "picture.png"
        link = f"{page.as_uri()}#t={TIME}&{CAMERA}"
        subprocess.run([chromium, *options, f"--screenshot={picture}", link], check=True, capture_output=True)
    print(picture)


if __name__ == "__main__":
    main()
