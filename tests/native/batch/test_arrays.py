"""Shapes as arrays: agreement with single calls, exact volumes of near-coincident boxes, published cases, refusals."""

from fractions import Fraction

import numpy as np
import pytest
import shapely
from families import Case, PosedBox
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from strategies import quaternion

from overlapper import Box, Placed, Sphere, arrays, iou, overlap, overlaps

MAKERS = {
    "boxes": lambda rng, n, *pose: arrays.boxes(rng.uniform(0.5, 2, (n, 3)), *pose),
    "spheres": lambda rng, n, positions, _: arrays.spheres(rng.uniform(0.3, 1, n), positions),
    "capsules": lambda rng, n, *pose: arrays.capsules(*rng.uniform(0.3, 1, (2, n)), *pose),
    "cylinders": lambda rng, n, *pose: arrays.cylinders(*rng.uniform(0.3, 1, (2, n)), *pose),
    "ellipsoids": lambda rng, n, *pose: arrays.ellipsoids(rng.uniform(0.3, 1, (n, 3)), *pose),
}


def random_poses(rng, n, spread=1.0):
    return rng.uniform(-spread, spread, (n, 3)), np.array([quaternion(rng) for _ in range(n)]).reshape(n, 4)


@pytest.mark.parametrize("kind", MAKERS)
@pytest.mark.parametrize("threads", [1, 3])
def test_volumes_are_those_of_overlap(kind, threads):
    """Boxes agree within the errors of both ways. All others have the same bits."""
    rng = np.random.default_rng(5)
    a = MAKERS["boxes"](rng, 7, *random_poses(rng, 7))
    b = MAKERS[kind](rng, 5, *random_poses(rng, 5))
    volumes = arrays.volume(a, b, threads=threads)
    ratios = arrays.iou(a, b, threads=threads)
    assert volumes.shape == ratios.shape == (7, 5) and (volumes > 0).any() and (volumes == 0).any()
    for i in range(7):
        for j in range(5):
            single = overlap(a[i], b[j])
            if kind == "boxes":
                assert abs(volumes[i, j] - single.volume) <= single.volume_error + 1e-12 * volumes[i, j]
                assert ratios[i, j] == pytest.approx(iou(a[i], b[j]), rel=4e-12)
            else:
                assert volumes[i, j] == single.volume
                assert ratios[i, j] == iou(a[i], b[j])
    rows = arrays.boxes(rng.uniform(0.5, 2, (5, 3)), *random_poses(rng, 5))
    assert arrays.volume(rows, b, aligned=True).tolist() == np.diag(arrays.volume(rows, b)).tolist()
    assert arrays.iou(rows, b, aligned=True).tolist() == np.diag(arrays.iou(rows, b)).tolist()


def posed_boxes(rng, n):
    """Pairs of boxes of all sorts: near each other or not, turned alike or nearly, thin, flush, far from the origin."""
    sizes = 10 ** rng.uniform(-0.3, 0.3, (n, 3)) * np.where(
        rng.random((n, 3)) < 0.2, 10 ** rng.uniform(-4, 4, (n, 3)), 1
    )
    positions, orientations = rng.uniform(-1, 1, (n, 3)) * rng.choice([1, 1000], (n, 1)), rng.normal(size=(n, 4))
    orientations[rng.random(n) < 0.3, :2] = 0
    orientations /= np.linalg.norm(orientations, axis=1, keepdims=True)
    axes = arrays.boxes(sizes, positions, orientations).rotations

    def offsets(*shape):
        return 10 ** rng.uniform(-17, 0, (n, 1)) * rng.normal(size=shape) * rng.choice([0, 1, 1], (n, 1))

    moves = offsets(n, 3) + rng.choice([0, 0, 0.5, 1], (n, 1)) * np.eye(3)[rng.integers(3, size=n)]
    there = positions + np.einsum("nij,nj->ni", axes, moves * sizes)
    turned = orientations + offsets(n, 4)
    turned[rng.random(n) < 0.2] = rng.normal(size=4)
    return (sizes, positions, orientations), (sizes * np.exp(offsets(n, 3)), there, turned)


def test_volumes_of_boxes_agree_with_overlaps_within_both_errors():
    rng, n = np.random.default_rng(12), 6000
    one, other = posed_boxes(rng, n)
    volumes = arrays.volume(arrays.boxes(*one), arrays.boxes(*other), aligned=True)
    shapes = [Box(size / 2) for size in np.vstack([one[0], other[0]])]
    places, turns = (np.vstack([each, near]) for each, near in zip(one[1:], other[1:]))
    rows = np.c_[np.arange(n), np.arange(n) + n]
    found = overlaps(shapes, places, turns, pairs=rows, separated=True)
    assert len(found) == n and len({*found.way}) >= 5
    assert (np.abs(volumes - found.volume) <= found.volume_error + 1e-12 * volumes).all()
    assert 0.2 < (volumes != found.volume).mean() < 0.8


def test_volumes_of_boxes_depend_neither_on_the_order_nor_on_other_pairs():
    rng = np.random.default_rng(13)
    one, other = (arrays.boxes(*each) for each in posed_boxes(rng, 30))
    volumes = arrays.volume(one, other)
    assert arrays.volume(other, one).T.tolist() == volumes.tolist()
    rows = arrays.volume(one, other, aligned=True)
    assert rows.tolist() == np.diag(volumes).tolist()
    numbers = posed_boxes(np.random.default_rng(13), 30)
    for k in range(30):
        alone = [arrays.boxes(*(column[k : k + 1] for column in each)) for each in numbers]
        assert arrays.volume(*alone)[0, 0] == rows[k]


def test_volumes_of_boxes_on_a_grid_are_whole_numbers():
    """Flush, touching, equal and nested boxes."""
    rng, n = np.random.default_rng(14), 2000
    quarters = Rotation.create_group("O").as_quat()
    lower, sizes = rng.integers(-3, 4, (2, n, 3)).astype(float), rng.integers(1, 5, (2, n, 3)).astype(float)
    turns = quarters[rng.integers(len(quarters), size=(2, n))]
    a, b = (arrays.boxes(*each) for each in zip(sizes, lower + sizes / 2, turns))
    whole = np.abs(np.einsum("knij,knj->kni", [a.rotations.round(), b.rotations.round()], sizes))
    low, high = lower + sizes / 2 - whole / 2, lower + sizes / 2 + whole / 2
    sides = np.minimum(*high) - np.maximum(*low)
    expected = sides.clip(0).prod(1)
    volumes = arrays.volume(a, b, aligned=True)
    assert np.abs(volumes - expected).max() <= 1e-12 * expected.max()
    assert (volumes[expected == 0] < 1e-13).all() and (volumes[(sides < 0).any(1)] == 0).all()
    assert (expected == 0).sum() > 100 and (sides == 0).any(1).sum() > 50
    assert (arrays.iou(a, b, aligned=True) <= 1).all()


# Volumes whose error in doubles is small enough, in m³.
SAME_BITS = [
    "0x1.dbc2c9f0d247bp+0",
    "0x1.e52452bd83c60p-1",
    "0x1.909b54c7ca231p+0",
    "0x1.6a6dc65b9d1b0p+0",
    "0x1.1f62f1dbb5a40p+1",
    "0x1.685b0c886bcc5p-1",
    "0x1.f532a96f318f1p+0",
    "0x1.217dfe9c30c05p+0",
]


def test_volumes_of_boxes_have_the_same_bits_on_every_machine():
    numbers = np.arange(1, 161) * 37 % 64
    sizes, positions, turns = numbers[:48].reshape(16, 3), numbers[48:96].reshape(16, 3), numbers[96:].reshape(16, 4)
    made = arrays.boxes(1 + sizes / 64, positions / 64, turns - 32.0)
    found = [float(volume).hex() for volume in arrays.volume(made, made)[range(8), range(8, 16)]]
    assert found == SAME_BITS


@pytest.mark.parametrize("yaw", [False, True], ids=["any rotation", "yaw"])
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("offset", [1.0, 0.1, 1e-2, 1e-3, 1e-5, 1e-8, 0.0])
def test_volumes_of_near_coincident_boxes_are_exact_to_a_trillionth(offset, size, yaw):
    rng = np.random.default_rng([int(-np.log10(offset)) if offset else 99, yaw])
    sizes = size * rng.uniform(0.5, 2, (4, 3))
    positions, orientations = random_poses(rng, 4, size)
    if yaw:
        orientations[:, :2] = 0
    turn = rng.normal(size=(4, 4)) * offset * 0.3
    if yaw:
        turn[:, :2] = 0
    near = positions + size * offset * 0.3 * rng.normal(size=(4, 3)), orientations + turn
    grown = sizes * np.exp(0.3 * offset * rng.normal(size=(4, 3)))
    a, b = arrays.boxes(sizes, positions, orientations), arrays.boxes(grown, *near)
    volumes, ratios = arrays.volume(a, b, aligned=True), arrays.iou(a, b, aligned=True)
    assert (ratios <= 1).all()
    for k in range(4):
        bodies = (
            PosedBox(sizes[k] / 2, positions[k], orientations[k]),
            PosedBox(grown[k] / 2, near[0][k], near[1][k]),
        )
        truth = Case("near", offset, bodies).truth
        exactly = truth.volume if truth.dimension == 3 else Fraction(0)
        assert abs(Fraction(volumes[k]) - exactly) <= Fraction(1, 10**12) * exactly
        own = [Fraction(float(s[0])) * Fraction(float(s[1])) * Fraction(float(s[2])) for s in (sizes[k], grown[k])]
        assert ratios[k] == pytest.approx(float(exactly / (sum(own) - exactly)), rel=4e-12)


# Boxes that are published as wrong in pytorch3d, with the true IoU: numbers of its issues.
PUBLISHED = {
    1054: (
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
        [[0.5, 0.5, 0], [1.5, 0.5, 0], [1.5, 1.5, 0], [0.5, 1.5, 0]]
        + [[0.5, 0.5, 1], [1.5, 0.5, 1], [1.5, 1.5, 1], [0.5, 1.5, 1]],
        1 / 7,
    ),
    1082: (
        [[19.7804, -4.8337, -1.2441], [24.3597, -4.8431, -1.2441], [24.3648, -2.3689, -1.2441]]
        + [[19.7855, -2.3595, -1.2441], [19.7804, -4.8337, 0.8192], [24.3597, -4.8431, 0.8192]]
        + [[24.3648, -2.3689, 0.8192], [19.7855, -2.3595, 0.8192]],
        [[19.8159, -4.8659, -1.25], [24.4267, -4.8794, -1.25], [24.4341, -2.3641, -1.25], [19.8233, -2.3506, -1.25]]
        + [[19.8159, -4.8659, 0.85], [24.4267, -4.8794, 0.85], [24.4341, -2.3641, 0.85], [19.8233, -2.3506, 0.85]],
        0.944907,
    ),
    1148: ([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)],) * 2 + (1.0,),
    1429: (
        [[x, y, z] for z in (1, -1) for x, y in [(844.4573, 545.2485), (876.2981, 549.768)]
         + [(865.3027, 627.2315), (833.4619, 622.712)]],
        [[x, y, z] for z in (1, -1) for x, y in [(847.1049, 545.0182), (878.9629, 550.236)]
         + [(866.222, 628.0273), (834.364, 622.8095)]],
        0.887689,
    ),
    1551: (
        [[x, y, z] for z in (-254.5391, -253.7584) for x, y in [(-24931.9805, 40325.3438), (-24931.1562, 40325.4336)]
         + [(-24931.3105, 40326.8789), (-24932.1348, 40326.7891)]],
    ) * 2 + (1.0,),
}  # fmt: skip


@pytest.mark.parametrize("issue", PUBLISHED)
def test_published_cases_of_pytorch3d(issue):
    a, b, true = PUBLISHED[issue]
    assert arrays.iou([a], [b])[0, 0] == pytest.approx(true, abs=5e-7)
    hulls = overlap(np.array(a, float), np.array(b, float)).volume
    assert arrays.volume([a], [b])[0, 0] == pytest.approx(hulls, rel=1e-4)


def test_corners_in_any_order_are_those_of_the_same_box():
    rng = np.random.default_rng(3)
    sizes, (positions, orientations) = rng.uniform(0.5, 2, (20, 3)), random_poses(rng, 20)
    straight, given = arrays.boxes(sizes, positions, orientations), arrays.corners(sizes, positions, orientations)
    for corners in (given, given[:, rng.permutation(8)], given[:, ::-1], given[:, [4, 5, 6, 7, 0, 1, 2, 3]]):
        made = arrays.boxes_of_corners(corners)
        assert arrays.iou(made, straight, aligned=True).min() > 1 - 1e-14
        assert made.volume == pytest.approx(straight.volume, rel=1e-14)


def test_rectangles_have_the_areas_of_shapely():
    rng = np.random.default_rng(8)
    rows = np.c_[rng.uniform(-1, 1, (2, 40, 2)), rng.uniform(0.2, 2, (2, 40, 2)), rng.uniform(-9, 9, (2, 40, 1))]

    def polygon(row):
        turn, half = Rotation.from_euler("z", row[4]).as_matrix()[:2, :2], row[2:4] / 2
        return shapely.Polygon([turn @ (half * side) + row[:2] for side in ([-1, -1], [1, -1], [1, 1], [-1, 1])])

    a, b = ([polygon(row) for row in side] for side in rows)
    areas = np.array([[p.intersection(q).area for q in b] for p in a])
    unions = np.array([[p.union(q).area for q in b] for p in a])
    around = np.array([[p.union(q).convex_hull.area for q in b] for p in a])
    assert arrays.volume(*rows) == pytest.approx(areas, abs=1e-13)
    assert arrays.iou(*rows) == pytest.approx(areas / unions, abs=1e-13)
    assert arrays.giou(*rows) == pytest.approx(areas / unions - (around - unions) / around, abs=1e-12)
    corners = np.array([[p.bounds + q.bounds for q in b] for p in a])
    wide = np.maximum(corners[..., 2:4], corners[..., 6:]) - np.minimum(corners[..., :2], corners[..., 4:6])
    apart = ((rows[0][:, None, :2] - rows[1][None, :, :2]) ** 2).sum(-1) / (wide**2).sum(-1)
    assert arrays.diou(*rows) == pytest.approx(areas / unions - apart, abs=1e-12)
    assert arrays.iou(rows[0], rows[0], aligned=True) == pytest.approx(1, abs=1e-14)


def test_giou_and_diou_of_boxes():
    rng = np.random.default_rng(4)
    sizes = rng.uniform(0.5, 2, (2, 30, 3))
    a, b = (arrays.boxes(each, *random_poses(rng, 30, 1.5)) for each in sizes)
    around = [ConvexHull(np.vstack([p.bounds, q.bounds])) for p, q in zip(a, b)]  # of axis-aligned boxes, for diou
    points = [arrays.corners(each, rows.positions, rows.rotations) for each, rows in zip(sizes, (a, b))]
    hulls = np.array([ConvexHull(np.vstack([p, q])).volume for p, q in zip(*points)])
    shared = arrays.volume(a, b, aligned=True)
    union = a.volume + b.volume - shared
    assert arrays.giou(a, b, aligned=True) == pytest.approx(shared / union - (hulls - union) / hulls, abs=1e-12)
    wide = np.array([hull.max_bound - hull.min_bound for hull in around])
    apart = ((a.positions - b.positions) ** 2).sum(1) / (wide**2).sum(1)
    assert arrays.diou(a, b, aligned=True) == pytest.approx(shared / union - apart, abs=1e-12)
    assert arrays.giou(a, b)[3, 3] == arrays.giou(a, b, aligned=True)[3]
    assert arrays.diou(a, b)[3, 3] == arrays.diou(a, b, aligned=True)[3]


class Foreign:
    """An array of another library: only DLPack."""

    def __init__(self, array):
        self.array = array

    def __dlpack__(self, **options):
        return self.array.__dlpack__(**options)

    def __dlpack_device__(self):
        return self.array.__dlpack_device__()


def test_arrays_of_any_type_strides_and_library():
    rng = np.random.default_rng(2)
    sizes, (positions, orientations) = rng.uniform(0.5, 2, (6, 3)).astype(np.float32), random_poses(rng, 6)
    expected = arrays.volume(arrays.boxes(sizes.astype(float), positions, orientations), arrays.spheres(np.ones(6)))
    frozen = sizes.copy()
    frozen.flags.writeable = False
    for each in (sizes, frozen, np.asfortranarray(sizes), np.repeat(sizes, 2, 0)[::2], Foreign(sizes), sizes.tolist()):
        made = arrays.boxes(each, Foreign(positions), orientations)
        assert arrays.volume(made, arrays.spheres(np.ones(6))).tolist() == expected.tolist()
    matrices = arrays.boxes(sizes, positions, Rotation.from_quat(orientations).as_matrix())
    assert arrays.volume(matrices, arrays.spheres(np.ones(6))) == pytest.approx(expected, rel=1e-12)
    scipy = arrays.boxes(sizes, positions, Rotation.from_quat(orientations))
    assert arrays.volume(scipy, arrays.spheres(np.ones(6))) == pytest.approx(expected, rel=1e-12)


def test_empty_arrays_have_empty_answers():
    none, one = arrays.boxes(np.empty((0, 3))), arrays.boxes([[1, 1, 1]])
    for of in (arrays.volume, arrays.iou, arrays.giou, arrays.diou):
        assert of(none, one).shape == (0, 1) and of(one, none).shape == (1, 0)
        assert of(none, none, aligned=True).shape == (0,)
        assert of(np.empty((0, 5)), np.empty((0, 5))).shape == (0, 0)
        assert of(np.empty((0, 8, 3)), one).shape == (0, 1)
        assert of([], one).shape == (0, 1) and of(one, []).shape == (1, 0)
        assert of(np.empty((0, 5)), one).shape == of([], [[0, 0, 1, 1, 0]]).shape == (0, 1)


def test_an_empty_list_makes_no_shapes():
    made = [arrays.boxes([]), arrays.boxes([], [], []), arrays.boxes_of_corners([]), arrays.rectangles([])]
    made += [arrays.spheres([]), arrays.capsules([], []), arrays.cylinders([], []), arrays.ellipsoids([], [])]
    assert [len(each) for each in made] == [0] * len(made)
    assert arrays.corners([]).shape == (0, 8, 3)
    none, some = arrays.volume_gradient([], [[0, 0, 1, 1, 0], [1, 0, 1, 1, 0]])
    assert len(none.sizes) == len(none.positions) == len(none.rotations) == 0
    assert [each.tolist() for each in some] == [[[0, 0]] * 2, [[0, 0]] * 2, [[0]] * 2]
    with pytest.raises(ValueError, match=r"^positions must have a row for each of the 3 boxes, not 0$"):
        arrays.boxes(THREE, [])
    with pytest.raises(ValueError, match=r"^a must be shapes"):
        arrays.iou([[]], arrays.boxes(THREE))


def test_rows_of_an_array_are_placed_shapes():
    rows = arrays.spheres([1, 2], [[0, 0, 1], [0, 0, 2]])
    assert len(rows) == 2 and repr(rows) == "ShapeArray(2 spheres)" and rows.kind == "spheres"
    assert repr(rows[-1]) == repr(Placed(Sphere(2), (0, 0, 2)))
    assert rows.volume.tolist() == [Sphere(1).volume, Sphere(2).volume]
    assert rows.bounds.tolist() == [[[-1, -1, 0], [1, 1, 2]], [[-2, -2, 0], [2, 2, 4]]]
    with pytest.raises(IndexError):
        rows[2]


THREE = np.ones((3, 3))


def changed(value, row=1, column=0, of=THREE):
    array = np.array(of, float)
    array[row, column] = value
    return array


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: arrays.boxes(changed(np.nan)), r"^sizes\[1\] must be finite$"),
        (lambda: arrays.boxes(changed(0)), r"^sizes\[1\] must be greater than 0, not 0\.0"),
        (lambda: arrays.boxes(changed(-2, 2)), r"^sizes\[2\] must be greater than 0, not -2\.0"),
        (lambda: arrays.boxes(np.ones((3, 2))), r"^sizes must be .* shape \(n, 3\), not of shape \(3, 2\)$"),
        (lambda: arrays.boxes("boxes"), r"^sizes must be an array of numbers of shape \(n, 3\)$"),
        (lambda: arrays.boxes(THREE, changed(np.inf)), r"^positions\[1\] must be finite$"),
        (lambda: arrays.boxes(THREE, np.ones((2, 3))), r"^positions must have a row for each of the 3 boxes, not 2$"),
        (lambda: arrays.boxes(THREE, THREE, np.zeros((3, 4))), r"^orientations\[0\] must not be the zero quaternion$"),
        (lambda: arrays.boxes(THREE, THREE, np.ones((3, 3, 3))), r"^orientations\[0\] must not scale"),
        (lambda: arrays.boxes(THREE, THREE, THREE), r"^orientations must be .* not of shape \(3, 3\)$"),
        (lambda: arrays.boxes(THREE, THREE, np.ones((2, 4))), r"^orientations must have a row for each of the 3"),
        (lambda: arrays.spheres([1, -1]), r"^radii\[1\] must be greater than 0"),
        (lambda: arrays.spheres([[1.0]]), r"^radii must be .* shape \(n,\), not of shape \(1, 1\)$"),
        (lambda: arrays.capsules([1, 1], [0, -1]), r"^lengths\[1\] must not be negative"),
        (lambda: arrays.cylinders([1, 1], [1]), r"^lengths must have a row for each of the 2 cylinders, not 1$"),
        (lambda: arrays.ellipsoids(changed(np.nan)), r"^half_axes\[1\] must be finite$"),
        (lambda: arrays.rectangles(np.ones((2, 4))), r"^rectangles must be .* \(n, 5\)"),
        (lambda: arrays.rectangles([[0, 0, 1, 0, 0]]), r"^rectangles\[0\] must be greater than 0"),
        (lambda: arrays.rectangles([[0, 0, 1, 1, np.nan]]), r"^rectangles\[0\] must be finite$"),
        (lambda: arrays.rectangles([[np.nan, 0, 1, 1, 0]]), r"^rectangles\[0\] must be finite$"),
        (
            lambda: arrays.boxes_of_corners(np.zeros((2, 8, 3))),
            r"^corners\[0\] must be the corners of a box with a vol",
        ),
        (lambda: arrays.boxes_of_corners(np.zeros((2, 7, 3))), r"^corners must be .* \(n, 8, 3\), not of"),
        (lambda: arrays.iou(np.full((1, 8, 3), np.nan), np.ones((1, 8, 3))), r"^a\[0\] must be finite$"),
        (lambda: arrays.iou(arrays.boxes(THREE), THREE), r"^b must be shapes of overlapper\.arrays, corners"),
        (lambda: arrays.iou("boxes", THREE), r"^a must be shapes of overlapper\.arrays, corners"),
        (lambda: arrays.iou(arrays.boxes(THREE), np.ones((1, 5))), r"^b must be rectangles if a is, and only then$"),
        (lambda: arrays.volume(arrays.boxes(THREE), arrays.spheres([1]), aligned=True), r"^b must have as many rows"),
        (lambda: arrays.volume_gradient(arrays.boxes(THREE), arrays.boxes(THREE), THREE * np.nan), r"^weights must be"),
        (lambda: arrays.volume_gradient([[0, 0, 1, 1, 0]], [[2, 0, 1, 1, 0]], [[np.inf]]), r"^weights must be finite$"),
        (lambda: arrays.giou(arrays.boxes(THREE), arrays.spheres([1])), r"^b must be boxes or rectangles$"),
        (lambda: arrays.volume(arrays.boxes(THREE), arrays.boxes(THREE), threads=0), r"^threads must be 1 or more"),
        (lambda: arrays.volume(arrays.boxes(THREE), arrays.boxes(THREE), tolerance=0), r"^tolerance must be greater"),
    ],
)
def test_refusals_name_the_argument_and_the_row(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_corners_off_a_box_are_refused():
    corners = arrays.corners([[1, 1, 1]])
    corners[0, 6] += 0.1
    with pytest.raises(ValueError, match=r"^corners\[0\] must be the 8 corners of a box; one is 0\.\d+ m off"):
        arrays.boxes_of_corners(corners)
