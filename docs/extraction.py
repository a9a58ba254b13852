"""Makes docs/extraction.png: what is modelled of three models of pybullet_data, in colours by kind of shape.

python docs/extraction.py
"""

from pathlib import Path

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt
import numpy as np
import pybullet
import pybullet_data
from matplotlib.patches import Patch
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from overlapper import HalfSpace
from overlapper.simulation import Bodies
from overlapper.viewer.tessellation import tessellation

MODELS = {
    "r2d2.urdf": (25, -60),
    "laikago/laikago_toes_zup.urdf": (20, -125),
    "mjcf/humanoid_symmetric.xml": (15, -150),
}
COLORS = {"Hull": "#4c78a8", "Box": "#f58518", "Sphere": "#54a24b", "Capsule": "#b279a2"}


def main() -> None:
    figure = plt.figure(figsize=(12, 5))
    for place, (model, (elevation, azimuth)) in enumerate(MODELS.items(), 1):
        bodies = loaded(model)
        axes = figure.add_subplot(1, 3, place, projection="3d")
        corners = np.concatenate(
            [draw(axes, placed) for placed in bodies.placed if type(placed.shape) is not HalfSpace]
        )
        middle, reach = (corners.min(axis=0) + corners.max(axis=0)) / 2, np.ptp(corners, axis=0).max() / 2
        axes.set(**{f"{axis}lim": (x - reach, x + reach) for axis, x in zip("xyz", middle)})
        axes.set_box_aspect((1, 1, 1), zoom=1.2)
        axes.view_init(elevation, azimuth)
        axes.set_axis_off()
        axes.set_title(f"{Path(model).name}: {len(bodies.shapes)} shapes", y=1.02)
    legend = [Patch(color=color, label=kind.lower()) for kind, color in COLORS.items()]
    figure.legend(handles=legend, loc="lower center", ncols=len(legend), frameon=False)
    figure.subplots_adjust(0, 0.06, 1, 0.92, 0)
    figure.savefig(Path(__file__).with_suffix(".png"), dpi=110)


def loaded(model: str) -> Bodies:
    client = pybullet.connect(pybullet.DIRECT)
    pybullet.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
    (pybullet.loadMJCF if model.endswith(".xml") else pybullet.loadURDF)(model, physicsClientId=client)
    return Bodies(client)


def draw(axes: plt.Axes, placed) -> np.ndarray:
    """Draws a placed shape; returns its vertices in the world."""
    drawn = tessellation(placed.shape)
    rotation = np.array(pybullet.getMatrixFromQuaternion(placed.orientation)).reshape(3, 3)
    vertices = drawn.vertices @ rotation.T + placed.position
    color = COLORS[type(placed.shape).__name__]
    axes.add_collection3d(Poly3DCollection(vertices[drawn.faces], facecolors=color, shade=True, alpha=1))
    return vertices


if __name__ == "__main__":
    main()
