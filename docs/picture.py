"""Makes docs/picture.webp, the README's picture: a hand closes on a duck, as the page of the scene shows it.

python docs/picture.py
"""

import io
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from photograph import READ, ROOT, browser
from PIL import Image

FIRST, LAST, STEP = 0.36, 1.22, 0.02  # seconds: from the fingers about the duck's head to its being carried
SLOWER = 3.0  # times: the film, than the hand
HELD = 1500  # ms, of the last frame
SIZE = (720, 600)
AT = np.array([0.55, 0.0, 0.06])  # m, what the camera looks at
LIFTED, SPEED = 0.83, 0.36  # s, m/s: when the hand begins to go up, and how fast
FROM = np.array([0.21, -0.19, 0.09]), np.array([0.16, -0.15, 0.05])  # m from there, in the beginning and in the end
MOST = 3_000_000  # bytes that a README should ask for


def main() -> None:
    times = np.arange(FIRST, LAST, STEP)
    frames = []
    with tempfile.TemporaryDirectory() as folder, browser(*SIZE) as window:
        page = Path(folder, "franka_grasp.html")
        scene = ROOT / "scenes" / "franka_grasp.py"
        subprocess.run([sys.executable, "-m", "overlapper", "view", str(scene), "--html", str(page)], check=True)
        window.open(page.as_uri(), READ)
        window.ask(f"document.head.appendChild(document.createElement('style')).textContent = {HIDDEN!r}")
        top, bottom = (window.ask(f"{STAGE}.{side}") for side in ("top", "bottom"))
        for part, t in zip(np.linspace(0, 1, len(times)), times):
            at = AT + [0, 0, SPEED * max(0.0, t - LIFTED)]
            eye = at + (1 - part) * FROM[0] + part * FROM[1]
            link = f"#t={t:.3f}&from={','.join(map('{:.4f}'.format, eye))}&at={','.join(map('{:.4f}'.format, at))}"
            window.ask(f"location.hash = {link!r}")
            frames.append(Image.fromarray(window.picture()[round(top) : round(bottom)].astype("uint8")))
    picture = ROOT / "docs" / "picture.webp"
    picture.write_bytes(film(frames))
    print(picture)


STAGE = "document.querySelector('#stage').getBoundingClientRect()"
# All but the scene, its labels, and the chart, which is cut off.
HIDDEN = "#head, #left, #right, #legend { display: none !important }"


def film(frames: list[Image.Image]) -> bytes:
    """As good as its length allows."""
    durations = [round(1000 * STEP * SLOWER)] * (len(frames) - 1) + [HELD]
    for quality in (85, 75, 65, 50):
        made = io.BytesIO()
        frames[0].save(
            made, "WEBP", save_all=True, append_images=frames[1:], duration=durations, loop=0, quality=quality, method=6
        )
        if made.tell() <= MOST:
            return made.getvalue()
    sys.exit(f"the film is longer than {MOST:,} bytes")


if __name__ == "__main__":
    main()
