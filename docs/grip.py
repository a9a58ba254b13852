"""Makes docs/grip.png: the page of a Franka that grips a duck by what they share, with forces, as Chromium shows it.

python docs/grip.py
"""

import tempfile
from dataclasses import replace
from pathlib import Path

from photograph import ROOT, photograph

from overlapper.scenes.run import run
from overlapper.scenes.scene import load_scene
from overlapper.tables.outputs import recorder

LOOK = "t=1.24&from=0.745,-0.11,0.25&at=0.548,0,0.198&pair=duck.1,panda/panda_rightfinger"


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder, "franka_grasp.html")
        with recorder(page, []) as record:
            scene = load_scene(str(ROOT / "scenes" / "franka_grasp.py"))
            scene = replace(
                scene, contact="volumetric", volumetric={"stiffness": 1e7}
            )  # soft, so that overlaps are seen
            for frame in run(scene):
                record(frame)
        photograph(f"{page.as_uri()}#{LOOK}", ROOT / "docs" / "grip.png")


if __name__ == "__main__":
    main()
