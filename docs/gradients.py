"""Makes docs/gradients.png: what three examples end with, which move bodies by the derivatives of common volumes.

python docs/gradients.py
"""

import runpy
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from overlapper import Box, Hull, Placed
from overlapper.arrays import boxes

ROOT = Path(__file__).parents[1]
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
BLUE, ORANGE, GREY = "#0072b2", "#d55e00", "#9aa3b0"


def hull(placed: Placed) -> tuple[np.ndarray, list[np.ndarray]]:
    """Corners in the world and facets."""
    shape = placed.shape
    shape = Hull(shape.half_extents * CORNERS) if isinstance(shape, Box) else shape
    (turn,) = boxes([[1, 1, 1]], None, [placed.orientation]).rotations
    return shape.vertices @ turn.T + placed.position, shape.facets


def draw(axes: plt.Axes, bodies: list[tuple[Placed, str, float]], title: str) -> None:
    points = []
    for placed, color, opacity in bodies:
        corners, facets = hull(placed)
        points.append(corners)
        polygons = [corners[facet] for facet in facets]
        axes.add_collection3d(Poly3DCollection(polygons, facecolor=(color, opacity), edgecolor=(color, 0.9), lw=0.6))
    low, high = (side(np.vstack(points), axis=0) for side in (np.min, np.max))
    for k, limit in enumerate((axes.set_xlim, axes.set_ylim, axes.set_zlim)):
        limit(low[k], high[k])
    axes.set_box_aspect(high - low, zoom=0.95)
    axes.set_axis_off()
    axes.set_title(title, y=-0.05, fontsize=10)


def rows(sizes: np.ndarray, positions: np.ndarray, turns: np.ndarray) -> list[Placed]:
    made = boxes(sizes, positions, turns)
    return [made[k] for k in range(len(made))]


def fitted() -> tuple[list[tuple[Placed, str, float]], str]:
    end = runpy.run_path(str(ROOT / "examples/fit_boxes.py"))
    shown = [(rows(*(np.asarray(each, float)[:4] for each in end[name]))) for name in ("truth", "guess")]
    places = 2.2 * np.array([[-1, 0, -1], [1, 0, -1], [-1, 0, 1], [1, 0, 1]])
    bodies = []
    for each, color in zip(shown, (GREY, BLUE)):
        for k, place in enumerate(places):
            at = place + each[k].position - shown[0][k].position
            bodies.append((Placed(each[k].shape, at, each[k].orientation), color, 0.15))
    return bodies, f"fit_boxes.py: mean IoU {1 - float(end['value']) / 16:.4f}"


def packed() -> tuple[list[tuple[Placed, str, float]], str]:
    end = runpy.run_path(str(ROOT / "examples/pack_a_bin.py"))
    bodies = [(each, BLUE, 0.5) for each in rows(*(np.asarray(each, float) for each in (end["sizes"], *end["poses"])))]
    floor = Placed(Box([0.6, 0.6, 0.01]), (0, 0, -0.01))
    return [(floor, GREY, 0.2), *bodies], f"pack_a_bin.py: {1e6 * float(end['wrong'](end['poses'])):.1f} cm³ wrong"


def gripped() -> tuple[list[tuple[Placed, str, float]], str]:
    end = runpy.run_path(str(ROOT / "examples/gentle_grip.py"))
    fingers = [Placed(end["finger"], np.c_[np.eye(3), [side / 2, 0, 0]] @ end["gripper"]) for side in (-1, 1)]
    bodies = [(Placed(end["stone"]), GREY, 0.25), *((each, ORANGE, 0.4) for each in fingers)]
    return bodies, f"gentle_grip.py: 20 mm³ at each finger, {end['step']} Newton steps"


def main() -> None:
    figure, panels = plt.subplots(1, 3, figsize=(12, 4), subplot_kw={"projection": "3d", "proj_type": "ortho"})
    for axes, (bodies, title) in zip(panels, (fitted(), packed(), gripped())):
        axes.view_init(elev=22, azim=-65)
        draw(axes, bodies, title)
    figure.subplots_adjust(0, 0.06, 1, 1, 0)
    figure.savefig(ROOT / "docs" / "gradients.png", dpi=120, metadata={"Software": None})


if __name__ == "__main__":
    main()
