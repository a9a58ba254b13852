"""Makes the pictures of docs/how.md: the steps of the article, the round frame, other ways, slices, and lenses.

python docs/how.py
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Patch
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from mpl_toolkits.mplot3d.proj3d import proj_transform
from PIL import Image
from scipy.spatial import ConvexHull

from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Overlap, Placed, Sphere, overlap
from overlapper.viewer.look import LIGHT, OWNER_COLORS
from overlapper.viewer.tessellation import tessellation

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tests" / "support"))

from families import DODECAHEDRON, icosphere  # noqa: E402

INK, GREY, PALE, MARK = "#222222", (0.62, 0.66, 0.72), (0.93, 0.94, 0.95), "#d1206a"
VIEW = (20, -117)
TURN = (0.3, -0.5, 0.2, 0.8)
OTHER_TURN = (0.1, 0.25, -0.2, 1.0)

Ring = np.ndarray


# ----------------------------------------------------------------------------------------------------------- geometry


def dual_points(halfspaces: np.ndarray, point: np.ndarray) -> np.ndarray:
    """(n, 3) n / (d − n·p) of planes n·x <= d, given as rows (n, −d), about p."""
    return halfspaces[:, :3] / -(halfspaces @ np.append(point, 1))[:, None]


def analytic_centre(halfspaces: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Where the dual points sum to zero: the point of the largest product of distances, by Newton's steps."""
    point = inside
    for _ in range(100):
        duals = dual_points(halfspaces, point)
        step = np.linalg.solve(duals.T @ duals, -duals.sum(axis=0))
        decrement = np.sqrt(step @ duals.T @ duals @ step)
        point = point + step / (1 + decrement)
        if decrement < 1e-9:
            break
    return point


def round_axes(duals: np.ndarray) -> np.ndarray:
    """Axes in which the second moments of the dual points are the identity: x = centre + axes @ y."""
    values, vectors = np.linalg.eigh(duals.T @ duals)
    return vectors / np.sqrt(values) @ vectors.T


def rings(common: Overlap | Hull) -> list[Ring]:
    return [common.vertices[facet] for facet in common.facets]


def in_world(placed: Placed, points: np.ndarray) -> np.ndarray:
    (x, y, z, w), shape = placed.orientation, points.shape
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    return (points.reshape(-1, 3) @ turn.T + placed.position).reshape(shape)


def planes_of(placed: Placed) -> np.ndarray:
    """(n, 4) half-spaces of a polytope in the world, however little of them is common."""
    return overlap(placed, Placed(Box([100, 100, 100]))).halfspaces


# ------------------------------------------------------------------------------------------------------------ drawing


def stage(figure: plt.Figure, place: tuple[int, int, int], title: str, text: str, view=VIEW) -> Axes3D:
    axes = figure.add_subplot(*place, projection="3d", proj_type="ortho", computed_zorder=False)
    axes.set_axis_off()
    axes.set_autoscale_on(False)
    axes.view_init(*view)
    axes.set_title(title, fontsize=11, fontweight="bold", color=INK, loc="left", x=0.02, y=1.0)
    axes.text2D(0.02, 0.985, text, transform=axes.transAxes, fontsize=8.5, color=INK, va="top", linespacing=1.35)
    return axes


def frame(axes: Axes3D, points: np.ndarray, zoom: float = 1.3, drop: float = 0.0) -> None:
    """Shows what lies around the points, all axes alike; `drop` leaves room above for the text."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, reach = (low + high) / 2, (high - low).max() / 2
    middle = middle + [0, 0, drop * reach]
    axes.set(**{f"{axis}lim": (x - reach, x + reach) for axis, x in zip("xyz", middle)})
    axes.set_box_aspect((1, 1, 1), zoom=zoom)


def shaded(ring: Ring, middle: np.ndarray, color: Sequence[float], alpha: float) -> tuple[float, ...]:
    normal = sum(np.cross(ring[i] - ring[0], ring[i + 1] - ring[0]) for i in range(1, len(ring) - 1))
    normal = normal * np.sign(normal @ (ring.mean(axis=0) - middle)) / (np.linalg.norm(normal) or 1)
    light = 0.72 + 0.28 * max(0.0, float(normal @ LIGHT))
    return (*np.clip(light * np.array(color[:3]), 0, 1), alpha)


def facets_seen(common: Overlap) -> list[np.ndarray]:
    """Those that face the camera."""
    up, around = np.deg2rad(VIEW)
    towards = [np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)]
    return [facet for facet, plane in zip(common.facets, common.halfspaces) if plane[:3] @ towards > 0]


def seam(axes: Axes3D, common: Overlap) -> None:
    """Where the owner changes, as far as it is on the side that is seen."""
    number = {tuple(vertex): v for v, vertex in enumerate(common.vertices)}
    edges = {frozenset(edge) for facet in facets_seen(common) for edge in zip(facet, np.roll(facet, -1))}
    drawn = []
    for loop in common.patch:
        corners = [number[tuple(corner)] for corner in loop]
        drawn += [edge for edge in zip(corners, corners[1:] + corners[:1]) if frozenset(edge) in edges]
    lines(axes, common.vertices[np.array(drawn)], INK, 2.2, 1, 4)


def solid(axes: Axes3D, polygons: Sequence[Ring], colors, alpha=1.0, edge=INK, width=0.6, zorder=2) -> None:
    """Convex and closed, without the polygons that are left out: a colour for all, or one for each polygon."""
    if isinstance(colors, tuple):
        colors = [colors] * len(polygons)
    middle = np.concatenate(polygons).mean(axis=0)
    faces = [shaded(ring, middle, color, alpha) for ring, color in zip(polygons, colors)]
    axes.add_collection3d(
        Poly3DCollection(polygons, facecolors=faces, edgecolors=edge, linewidths=width, zorder=zorder)
    )


def lines(axes: Axes3D, segments: Iterable[np.ndarray], color, width=0.8, alpha=1.0, zorder=3, style="-") -> None:
    drawn = Line3DCollection(list(segments), colors=color, linewidths=width, alpha=alpha, zorder=zorder)
    drawn.set_linestyle(style)
    axes.add_collection3d(drawn)


def dots(axes: Axes3D, points: np.ndarray, color, size=26, zorder=6, edge=INK) -> None:
    axes.scatter(*np.atleast_2d(points).T, c=color, s=size, depthshade=False, zorder=zorder, edgecolors=edge, lw=0.6)


def label(axes: Axes3D, point: np.ndarray, text: str, shift=(6, 5), color=INK) -> None:
    axes.figure.canvas.draw()  # or the axes would have another projection
    x, y, _ = proj_transform(*point, axes.get_proj())
    axes.annotate(text, (x, y), xytext=shift, textcoords="offset points", fontsize=9.5, color=color, zorder=9)


def ghost(axes: Axes3D, placed: Placed, color, alpha=0.13, width=0.7) -> np.ndarray:
    """A translucent body and its edges; returns its corners."""
    drawn = tessellation(placed.shape)
    corners = in_world(placed, drawn.vertices)
    solid(axes, list(corners[drawn.faces]), color, alpha, edge="none", zorder=1)
    lines(axes, in_world(placed, drawn.wires), color, width, 0.8, zorder=2)
    return corners


def save(figure: plt.Figure, name: str) -> None:
    """With 256 colours, which is all that flat charts need."""
    path = HERE / name
    figure.savefig(path, dpi=120)
    plt.close(figure)
    with Image.open(path) as image:
        image.convert("RGB").quantize(256, kmeans=1).save(path, optimize=True)
    print(path)


def owners(figure: plt.Figure, **more) -> None:
    patches = [
        Patch(color=OWNER_COLORS[0], label="of the first body"),
        Patch(color=OWNER_COLORS[1], label="of the second"),
    ]
    figure.legend(handles=[*patches, *(Patch(color=c, label=t) for t, c in more.items())], loc="lower center",
                  ncols=4, frameon=False, fontsize=9)  # fmt: skip


# ------------------------------------------------------------------------------------------------- steps of the article


def draw_steps() -> None:
    first, second = Placed(Box([0.5, 0.5, 0.5])), Placed(Hull(0.42 * DODECAHEDRON), (0.48, -0.30, 0.42), OTHER_TURN)
    common = overlap(first, second)
    bodies = [planes_of(first), planes_of(second)]
    planes = np.vstack(bodies)
    owner = np.repeat([0, 1], [len(body) for body in bodies])
    colors = [OWNER_COLORS[k] for k in owner]
    found = np.array([0.2530159196513282, -0.08466998486956352, 0.3076280238506208])  # the witness point of GJK
    point = analytic_centre(common.halfspaces, common.centroid)
    duals = dual_points(planes, point)
    hull = ConvexHull(duals)
    used = np.zeros(len(duals), bool)
    used[hull.vertices] = True
    assert {tuple(h) for h in np.round(planes[used], 9)} == {tuple(h) for h in np.round(common.halfspaces, 9)}

    # One plane and one vertex are followed through all panels.
    facet = int(np.argmax([(o == 0) * len(f) for o, f in zip(common.owner, common.facets)]))
    plane = int(np.argmin(np.abs(planes - common.halfspaces[facet]).sum(axis=1)))
    direction = np.array([-0.3, -1.0, 0.4])
    vertex = max(common.facets[facet], key=lambda v: common.vertices[v] @ direction)
    corner = common.vertices[vertex]
    through = np.flatnonzero(np.abs(duals @ (corner - point) - 1) < 1e-9)

    figure = plt.figure(figsize=(10, 9.6))
    axes = stage(figure, (2, 2, 1), "1  A common point", "GJK with witness points finds one (black). Ours goes on\n"
                 "to the analytic centre p (pink), well inside.")  # fmt: skip
    seen = [ghost(axes, placed, color) for placed, color in zip((first, second), OWNER_COLORS)]
    lines(axes, [np.vstack([ring, ring[:1]]) for ring in rings(common)], INK, 0.9, 0.55)
    lines(axes, [np.vstack([ring, ring[:1]]) for ring in rings(common)[facet : facet + 1]], INK, 2.0, 1, 4)
    frame(axes, np.concatenate(seen))
    dots(axes, found, INK)
    dots(axes, point, MARK)
    label(axes, point, "p", color=MARK)
    label(axes, rings(common)[facet].mean(axis=0), "F", (-4, -4))

    axes = stage(figure, (2, 2, 2), "2  Planes become points", "The plane n·x = d of a facet becomes its dual point\n"
                 "n / (d − n·p): the nearer to p, the farther out.")  # fmt: skip
    lines(axes, [np.array([np.zeros(3), d]) for d in duals], [(*c, 0.7) for c in colors], 0.9)
    dots(axes, duals, [(*c, 1) for c in colors])
    dots(axes, np.zeros(3), MARK)
    frame(axes, duals)
    label(axes, duals[plane], "F*", (7, -3))
    label(axes, np.zeros(3), "p", color=MARK)

    axes = stage(figure, (2, 2, 3), "3  Their convex hull", "Built point by point; every decision is an exact sign.\n"
                 "Points inside (pale) belong to planes that cut off nothing.")  # fmt: skip
    faces = duals[hull.simplices]
    solid(axes, list(faces), PALE, 0.55, edge=(*GREY, 1), width=0.9)
    marked = [s for s in faces if all(np.abs(s @ (corner - point) - 1) < 1e-9)]
    axes.add_collection3d(Poly3DCollection(marked, facecolors=MARK, edgecolors=MARK, alpha=0.45, lw=1.2, zorder=4))
    dots(axes, duals[used], [(*c, 1) for c, u in zip(colors, used) if u])
    dots(axes, duals[~used], [(*(0.5 * np.array(c) + 0.5), 1) for c, u in zip(colors, used) if not u], 14, 5, GREY)
    frame(axes, duals)
    label(axes, duals[plane], "F*", (7, -3))
    label(axes, duals[through].mean(axis=0), "V*", (-6, -4))

    axes = stage(figure, (2, 2, 4), "4  The dual of the hull", "Each face of the hull is a vertex of what is common,\n"
                 "each vertex a facet, which knows its owner.")  # fmt: skip
    for placed, color in zip((first, second), OWNER_COLORS):
        lines(axes, in_world(placed, tessellation(placed.shape).wires), color, 0.6, 0.45, 1)
    solid(axes, rings(common), [OWNER_COLORS[o] for o in common.owner], 1.0)
    seam(axes, common)
    frame(axes, np.concatenate(seen))
    dots(axes, corner, MARK)
    label(axes, corner, "V", (7, 4))
    label(axes, rings(common)[facet].mean(axis=0), "F", (-4, -4))

    owners(figure)
    figure.subplots_adjust(0.01, 0.04, 0.99, 0.965, 0.02, 0.08)
    save(figure, "how.png")


# ------------------------------------------------------------------------------------------------------ the round frame


def draw_frame() -> None:
    thickness = 0.02
    first = Placed(Box([0.5, 0.5, 0.5]))
    second = Placed(Box([0.5, 0.5, 0.5]), (0.35, 0.2, 1 - thickness), (0, 0, 0.3, 1))
    common = overlap(first, second)
    point = analytic_centre(common.halfspaces, common.centroid)
    duals = dual_points(common.halfspaces, point)
    turned = duals @ round_axes(duals)
    colors = [OWNER_COLORS[o] for o in common.owner]

    figure = plt.figure(figsize=(11, 4.5))
    axes = stage(
        figure,
        (1, 3, 1),
        "A sliver",
        f"What two boxes share is {100 * thickness:.0f} cm thick,\n1 m being the side of a box.",
    )
    seen = [ghost(axes, placed, color) for placed, color in zip((first, second), OWNER_COLORS)]
    solid(axes, rings(common), colors, zorder=4)
    frame(axes, np.concatenate(seen), 1.05, 0.15)

    lengths = np.linalg.norm(duals, axis=1)
    nearest, farthest = lengths.min(), lengths.max()
    said = f"A needle: its points are {nearest:.1f} to {farthest:.0f} per m away.\nOf a thinner sliver it is longer."
    axes = stage(figure, (1, 3, 2), "Its dual, in the world", said)
    draw_hull(axes, duals, colors)

    lengths = np.linalg.norm(turned, axis=1)
    nearest, farthest = lengths.min(), lengths.max()
    said = f"The same, with second moments of one:\n{nearest:.2f} to {farthest:.2f} away, however thin the sliver."
    axes = stage(figure, (1, 3, 3), "Its dual, in the round frame", said)
    draw_hull(axes, turned, colors)
    owners(figure)
    figure.subplots_adjust(0.01, 0.05, 0.99, 0.92, 0.0, 0)
    save(figure, "how_frame.png")


def draw_hull(axes: Axes3D, duals: np.ndarray, colors) -> None:
    hull = ConvexHull(duals)
    solid(axes, list(duals[hull.simplices]), PALE, 0.55, edge=(*GREY, 1), width=0.9)
    dots(axes, duals, [(*c, 1) for c in colors])
    dots(axes, np.zeros(3), MARK)
    frame(axes, duals, 1.2, 0.1)


# ----------------------------------------------------------------------------------------------------------- other ways


def draw_ways() -> None:
    figure = plt.figure(figsize=(10, 9.6))
    draw_clipping(figure)
    draw_tracing(figure)
    draw_closed_form(figure)
    draw_tangent_planes(figure)
    owners(figure)
    figure.subplots_adjust(0.01, 0.04, 0.99, 0.965, 0.02, 0.08)
    save(figure, "how_ways.png")


def draw_clipping(figure: plt.Figure) -> None:
    bodies = Placed(Box([0.5, 0.5, 0.5])), Placed(Box([0.5, 0.5, 0.5]), (0.45, -0.25, 0.5), TURN)
    common = overlap(*bodies)
    assert common.way == "clipping"
    axes = stage(figure, (2, 2, 1), "clipping", "A vertex is a corner of one body inside the other (white),\n"
                 "or an edge of one crosses a facet of the other (black).")  # fmt: skip
    seen = [ghost(axes, placed, color) for placed, color in zip(bodies, OWNER_COLORS)]
    solid(axes, rings(common), [OWNER_COLORS[o] for o in common.owner], 0.9, zorder=3)
    around = [{int(o) for o, f in zip(common.owner, common.facets) if v in f} for v in range(len(common.vertices))]
    seen_corners = {int(v) for facet in facets_seen(common) for v in facet}
    for v, of in enumerate(around):
        if v in seen_corners:
            dots(axes, common.vertices[v], "white" if len(of) == 1 else INK, 30)
    frame(axes, np.concatenate(seen))


def draw_tracing(figure: plt.Figure) -> None:
    bodies = Placed(Hull(icosphere(3))), Placed(Hull(icosphere(3)), (0.75, -0.55, 0.55), TURN)
    common = overlap(*bodies)
    assert common.way == "tracing"
    axes = stage(figure, (2, 2, 2), "tracing", "The seam (black) is followed from facet to facet. What lies\n"
                 "within is kept; what lies outside is never looked at.")  # fmt: skip
    seen = []
    for placed, color in zip(bodies, OWNER_COLORS):
        hull = placed.shape
        polygons = [in_world(placed, np.asarray(ring)) for ring in rings(hull)]
        lines(axes, [np.vstack([ring, ring[:1]]) for ring in polygons], color, 0.25, 0.45, 1)
        seen.append(in_world(placed, np.asarray(hull.vertices)))
    solid(axes, rings(common), [OWNER_COLORS[o] for o in common.owner], 1.0, width=0.25, zorder=3)
    seam(axes, common)
    frame(axes, np.concatenate(seen))


def draw_closed_form(figure: plt.Figure) -> None:
    cylinder, plane = Placed(Cylinder(0.5, 1.4), (0, 0, 0.25), (0.35, 0.2, 0, 1)), Placed(HalfSpace([0, 0, 1], 0))
    assert overlap(cylinder, plane).way == "closed form"
    axes = stage(figure, (2, 2, 3), "closed form", "A ball, a capsule or a cylinder that one plane cuts, and the\n"
                 "lens of two balls: there are formulas, right to rounding.")  # fmt: skip
    corners = ghost(axes, cylinder, OWNER_COLORS[0])
    common = overlap(cylinder, plane, tolerance=1e-3)
    solid(axes, rings(common), [OWNER_COLORS[o] for o in common.owner], 1.0, edge="none", zorder=3)
    seam(axes, common)
    square = 0.85 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    axes.add_collection3d(
        Poly3DCollection([square], facecolors=[(*OWNER_COLORS[1], 0.22)], edgecolors=[OWNER_COLORS[1]], zorder=2)
    )
    frame(axes, np.concatenate([corners, square]), 1.2)


def draw_tangent_planes(figure: plt.Figure) -> None:
    room = Placed(Box([9, 9, 9]))  # three bodies have no slices
    bodies = Placed(Cylinder(0.5, 1.4)), Placed(Sphere(0.55), (0.3, -0.3, 0.6))
    axes = stage(figure, (2, 2, 4), "dual hull", "In a group, round bodies add tangent planes where the polytope\n"
                 "still reaches too far out; here to a tolerance of 0.05.")  # fmt: skip
    common = overlap(*bodies, room, tolerance=0.05)
    assert common.way == "dual hull"
    seen = [ghost(axes, placed, color, 0.10) for placed, color in zip(bodies, OWNER_COLORS)]
    solid(axes, rings(common), [OWNER_COLORS[o] for o in common.owner], 1.0, zorder=3)
    seam(axes, common)
    frame(axes, np.concatenate(seen))


# --------------------------------------------------------------------------------------------------------------- slices

RADIUS, HEIGHT, CUT = 0.3, 0.12, 0.05  # of a capsule along x: its axis over the edge, and where the cylinder ends


def slice_of(t: float) -> tuple[Ring, Ring]:
    """Outlines in the plane y = t of what the wedge z <= -|x| shares with the cylinder, and with the half ball."""
    reach = np.sqrt(max(0.0, RADIUS**2 - t**2))
    low = HEIGHT - reach
    right = min(-low, CUT)
    of_cylinder = np.array([[low, low], [right, low], [right, -right], [0, 0]])
    # From the cut along the face to where that leaves the disc, and back along the arc.
    a, b = CUT, HEIGHT
    half = (a - b) / 2 + np.sqrt(max(0.0, (a - b) ** 2 / 4 - (a * a + b * b - reach**2) / 2))
    if not low < -CUT:
        return of_cylinder, np.zeros((0, 2))
    end = np.arctan2(-half - b, half - a)
    arc = np.linspace(end, -np.pi / 2, 24)
    of_ball = np.column_stack([a + reach * np.cos(arc), b + reach * np.sin(arc)])
    return of_cylinder, np.vstack([[CUT, -CUT], of_ball])


def area_of(ring: Ring) -> float:
    x, z = ring.T
    return abs(x @ np.roll(z, -1) - z @ np.roll(x, -1)) / 2 if len(ring) else 0.0


def draw_slices() -> None:
    capsule = Placed(Capsule(RADIUS, 1.0), (CUT - 0.5, 0, HEIGHT), (0, np.sqrt(0.5), 0, np.sqrt(0.5)))
    box = Placed(Box([0.55, 0.55, 0.55]), (0, 0, -0.55 * np.sqrt(2)), (0, np.sin(np.pi / 8), 0, np.cos(np.pi / 8)))
    common = overlap(capsule, box)
    end, corner = np.sqrt(RADIUS**2 - HEIGHT**2), np.sqrt(RADIUS**2 - (HEIGHT + CUT) ** 2)
    levels = np.array([-end, -corner, corner, end])
    turn, half_ball = (18, -62), (0.55, 0.36, 0.05)
    spread = np.array([1, 2.2, 1])

    figure = plt.figure(figsize=(11, 4.4))
    axes = stage(figure, (1, 3, 1), "A capsule on the edge of a box", "It is cut into a cylinder and two half balls\n"
                 "(dashed); pieces that reach nothing are left out.", turn)  # fmt: skip
    seen = [ghost(axes, placed, color) for placed, color in zip((capsule, box), OWNER_COLORS)]
    around = np.linspace(0, 2 * np.pi, 60)
    circle = np.column_stack([np.full(60, CUT), RADIUS * np.cos(around), HEIGHT + RADIUS * np.sin(around)])
    lines(axes, [circle], INK, 0.9, 1, 5, "--")
    solid(axes, rings(common), [OWNER_COLORS[o] for o in common.owner], 1.0, edge="none", zorder=3)
    frame(axes, np.concatenate(seen), 1.2, 0.15)

    axes = stage(figure, (1, 3, 2), "Slices along the axis", "Of the cylinder each is a polygon, of the half ball\n"
                 "a polygon cut by one disc (dark); here drawn apart.", (14, -50))  # fmt: skip
    for t in np.linspace(-end, end, 11)[1:-1][::-1]:
        for ring, color in zip(slice_of(t), (OWNER_COLORS[0], half_ball)):
            if len(ring):
                placed = spread * np.insert(ring, 1, t, axis=1)
                drawn = Poly3DCollection([placed], facecolors=[(*color, 0.9)], edgecolors=INK, linewidths=0.6)
                axes.add_collection3d(drawn)
    corners = np.concatenate([np.insert(slice_of(t)[0], 1, t, axis=1) for t in (-end, 0, end)])
    frame(axes, spread * corners, 2.0, 0.05)

    axes = figure.add_axes((0.715, 0.13, 0.27, 0.62))
    axes.set_title("Their areas, integrated", fontsize=11, fontweight="bold", color=INK, loc="left", y=1.2)
    said = "Between the lines no outline changes, and a rule of\nGauss and Legendre in the angle is soon exact (dots)."
    axes.text(0, 1.18, said, transform=axes.transAxes, fontsize=8.5, color=INK, va="top", linespacing=1.35)
    ts = np.linspace(-end, end, 400)
    angles, _ = np.polynomial.legendre.leggauss(8)
    for piece, (color, name) in enumerate(((OWNER_COLORS[0], "of the cylinder"), (half_ball, "of the half ball"))):
        axes.plot(ts, [1e4 * area_of(slice_of(t)[piece]) for t in ts], color=color, lw=1.6, label=name)
        for low, high in pairwise(levels):
            at = (low + high) / 2 - (high - low) / 2 * np.cos(np.pi / 2 * (angles + 1))
            values = [1e4 * area_of(slice_of(t)[piece]) for t in at]
            if max(values) > 0:
                axes.plot(at, values, "o", ms=3, color=color)
    for level in levels:
        axes.axvline(level, color=GREY, lw=0.8, ls=":")
    axes.set(xlabel="t (m)", ylabel="area of the slice (cm²)")
    axes.legend(frameon=False, fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 0.42))
    axes.spines[["top", "right"]].set_visible(False)
    figure.subplots_adjust(0.0, 0.02, 1.0, 0.92, 0.0, 0)
    save(figure, "how_slices.png")


# --------------------------------------------------------------------------------------------------------------- lenses


class Lenses:
    """Two ellipsoids, the first about the origin and along the axes, in slices of which both are discs.

    All is in units of the first one's half axes, in which that is a unit ball.
    """

    def __init__(self, first: Placed, second: Placed) -> None:
        stretch = np.array(first.shape.half_axes)
        turn = in_world(Placed(second.shape, (0, 0, 0), second.orientation), np.eye(3))  # rows: the second's axes
        k = turn * stretch / np.array(second.shape.half_axes)[:, None]
        middle = turn @ second.position / second.shape.half_axes
        values, axes = np.linalg.eigh(k.T @ k)
        across = np.sqrt(values[1] - values[0]) * axes[:, 0] + np.sqrt(values[2] - values[1]) * axes[:, 2]
        self.normal = across / np.linalg.norm(across)
        self.plane = np.array([axes[:, 1], np.cross(self.normal, axes[:, 1])])
        self.k, self.middle, self.value = k, middle, values[1]

    def discs(self, t: float) -> list[tuple[np.ndarray, float]]:
        """The centre in the plane and the square of the radius, of both."""
        rest = self.middle - t * self.k @ self.normal
        centre = self.plane @ self.k.T @ rest / self.value
        return [(np.zeros(2), 1 - t * t), (centre, (1 - rest @ rest) / self.value + centre @ centre)]

    def circles(self, t: float) -> list[Ring]:
        around = np.linspace(0, 2 * np.pi, 181)
        ring = np.column_stack([np.cos(around), np.sin(around)])
        return [centre + np.sqrt(max(0.0, square)) * ring for centre, square in self.discs(t)]

    def lens(self, t: float) -> Ring:
        """What both discs share, as a polygon."""
        (_, first), (centre, second) = self.discs(t)
        if min(first, second) <= 0:
            return np.zeros((0, 2))
        one, two = self.circles(t)
        inside = [one[np.linalg.norm(one - centre, axis=1) <= np.sqrt(second)], two[(two * two).sum(axis=1) <= first]]
        points = np.concatenate(inside)
        return points[ConvexHull(points).vertices] if len(points) > 2 else np.zeros((0, 2))

    def area(self, t: float) -> float:
        (_, first), (centre, second) = self.discs(t)
        r, s, d = np.sqrt(max(0.0, first)), np.sqrt(max(0.0, second)), np.linalg.norm(centre)
        if d >= r + s or min(r, s) == 0:
            return 0.0
        if d <= abs(r - s):
            return float(np.pi * min(r, s) ** 2)
        along = [(d * d + sign * (r * r - s * s)) / (2 * d) for sign in (1, -1)]
        return float(sum(q * q * np.arccos(h / q) - h * np.sqrt(q * q - h * h) for q, h in zip((r, s), along)))

    def levels(self) -> np.ndarray:
        """Where the circles touch each other, by halving between samples."""

        def side(t: float) -> tuple[bool, bool, bool]:
            (_, first), (centre, second) = self.discs(t)
            r, s, d = np.sqrt(max(0.0, first)), np.sqrt(max(0.0, second)), np.linalg.norm(centre)
            return bool(min(first, second) > 0), bool(d < r + s), bool(d > abs(r - s))

        found = []
        for low, high in pairwise(np.linspace(-1, 1, 2000)):
            if side(low) == side(high):
                continue
            for _ in range(60):
                middle = (low + high) / 2
                low, high = (middle, high) if side(middle) == side(low) else (low, middle)
            if self.area(low - 1e-6) > 0 or self.area(high + 1e-6) > 0:
                found.append(high)
        return np.array(found)

    def in_space(self, t: float, ring: Ring, spread: float = 1.0) -> Ring:
        return ring @ self.plane + spread * t * self.normal


def draw_lenses() -> None:
    first = Placed(Ellipsoid([0.6, 0.4, 0.3]))
    second = Placed(Ellipsoid([0.25, 0.5, 0.35]), (0.42, -0.22, 0.2), TURN)
    common, lenses = overlap(first, second), Lenses(first, second)
    stretch, levels = np.array(first.shape.half_axes), lenses.levels()
    ts = np.linspace(levels[0], levels[-1], 400)
    areas = [lenses.area(t) for t in ts]
    assert abs(np.trapezoid(areas, ts) * np.prod(stretch) / common.volume - 1) < 1e-4
    shown = np.linspace(levels[0], levels[-1], 9)[1:-1]
    blend = tuple((np.array(OWNER_COLORS[0][:3]) + np.array(OWNER_COLORS[1][:3])) / 2)

    figure = plt.figure(figsize=(11, 4.4))
    axes = stage(figure, (1, 3, 1), "Two ellipsoids", "Planes of one direction cut both in ellipses of the\n"
                 "same shape; what the two ellipses share is drawn.")  # fmt: skip
    seen = [ghost(axes, placed, color) for placed, color in zip((first, second), OWNER_COLORS)]
    for t in shown[::-1]:
        ring = stretch * lenses.in_space(t, lenses.lens(t))
        axes.add_collection3d(Poly3DCollection([ring], facecolors=[(*blend, 0.9)], edgecolors=INK, linewidths=0.6))
    frame(axes, np.concatenate(seen), 1.25, 0.15)

    axes = figure.add_axes((0.355, 0.05, 0.3, 0.72))
    axes.set_title("A slice", fontsize=11, fontweight="bold", color=INK, loc="left", y=1.13)
    said = "In units of the first one's half axes, the ellipses\nare discs, and what they share is a lens."
    axes.text(0, 1.12, said, transform=axes.transAxes, fontsize=8.5, color=INK, va="top", linespacing=1.35)
    t = float(shown[len(shown) // 2])
    for ring, color in zip(lenses.circles(t), OWNER_COLORS):
        axes.fill(*ring.T, color=(*color[:3], 0.13), lw=0)
        axes.plot(*ring.T, color=color, lw=1.4)
    axes.fill(*lenses.lens(t).T, color=(*blend, 0.9), lw=0)
    for (centre, _), color in zip(lenses.discs(t), OWNER_COLORS):
        axes.plot(*centre, "o", ms=3, color=color)
    axes.set_aspect("equal")
    axes.set_axis_off()

    axes = figure.add_axes((0.715, 0.13, 0.27, 0.62))
    axes.set_title("The areas of lenses, integrated", fontsize=11, fontweight="bold", color=INK, loc="left", y=1.2)
    said = "Between the lines no outline changes, and a rule\nof Gauss and Legendre is soon exact (dots)."
    axes.text(0, 1.18, said, transform=axes.transAxes, fontsize=8.5, color=INK, va="top", linespacing=1.35)
    axes.plot(ts, areas, color=INK, lw=1.6)
    angles, _ = np.polynomial.legendre.leggauss(8)
    for low, high in pairwise(levels):
        at = (low + high) / 2 - (high - low) / 2 * np.cos(np.pi / 2 * (angles + 1))
        axes.plot(at, [lenses.area(each) for each in at], "o", ms=3, color=MARK)
    for level in levels:
        axes.axvline(level, color=GREY, lw=0.8, ls=":")
    axes.set(xlabel="t", ylabel="area of the lens")
    axes.spines[["top", "right"]].set_visible(False)
    figure.subplots_adjust(0.0, 0.02, 1.0, 0.92, 0.0, 0)
    save(figure, "how_lenses.png")


def main() -> None:
    draw_steps()
    draw_frame()
    draw_ways()
    draw_slices()
    draw_lenses()


if __name__ == "__main__":
    main()
