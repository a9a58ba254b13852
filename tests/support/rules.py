"""Rules that `auto` keeps in every case. A rule takes a case of families.py with the core's answer, and returns a
complaint, or nothing if the rule is kept."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from math import isqrt

import exact
import exact_distance
import numpy as np
from families import CORNERS, Below, Case, coarse, mapped, points_of, solid
from strategies import product, quaternion, rotation

from overlapper import Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Hull, Overlap, Placed, RoundedHull, Sphere, overlap
from overlapper.proof.certificate import certificate

HALF_ULP = 2.0**-53
NEGLIGIBLE = 1e-12  # of the size of the smallest body: what is nearer or thinner may be called touching
TOLERANCE = 1e-2  # of round bodies, whose closed form must lie in the bracket whatever it is

# Pairs of these kinds are measured by clipping, tracing, closed forms and slices. Tangent planes enclose other pairs.
FLAT = (Box, Hull, HalfSpace)
ROUND = (Sphere, Capsule, Cylinder, RoundedHull)
WITHOUT_RIMS = {*FLAT, Sphere, Capsule, RoundedHull}  # their cores have corners and straight edges

DIRECTIONS = np.vstack([CORNERS / np.sqrt(3), np.eye(3), -np.eye(3), *np.random.default_rng(0).normal(size=(32, 1, 3))])
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1)[:, None]

Rule = Callable[[Case, Overlap], str]
Offs = dict[str, tuple[Fraction | float, float]]  # by measure: how far an answer is off, and its stated error


def answer(bodies) -> Overlap:
    return overlap(*bodies, tolerance=TOLERANCE)


def beyond(off: Offs) -> str:
    complaints = (
        f"{name} is off by {float(by):.3g}, not {error:.3g}" for name, (by, error) in off.items() if by > error
    )
    return "; ".join(complaints)


def reached(case: Case, found: Overlap) -> dict[str, float]:
    """By measure, the part of its stated error by which an answer is off; of errors that are not 0."""
    off = off_volume(case, found) | off_way(case, found) | off_witnesses(case, found) | off_measures(case, found)
    return {name.split(" on ")[0]: float(Fraction(by) / Fraction(error)) for name, (by, error) in off.items() if error}


# The exact truth of a case


def holds_a_ball(case: Case, radius: float) -> bool:
    """Whether the common part surely holds a ball of that radius. A solid's inradius is between V / A and 3 V / A."""
    if case.truth.dimension < 3:
        return False
    least = float(case.truth.volume) / case.truth.area
    return least > radius or (3 * least > radius and moved_planes_leave_something(case, -Fraction(radius)))


def apart_by(case: Case, gap: float) -> bool:
    """Whether no point is as near as `gap` to every body, seen by moving out all planes; by the distance for pairs."""
    if not moved_planes_leave_something(case, Fraction(gap)):
        return True
    if len(case.solids) == len(case.bodies) == 2 and np.prod([len(s.vertices) for s in case.solids]) < 400:
        return exact.distance_squared(*case.solids) > Fraction(gap) ** 2
    return False


def moved_planes_leave_something(case: Case, outwards: Fraction) -> bool:
    planes = [plane for solid in case.solids for plane in solid.planes]
    planes += [exact.halfspace(*body) for body in case.bodies if isinstance(body, Below)]
    part = exact.hull(CORNERS * 4 * max(1.0, *(float(np.abs(box).max()) for box in case.boxes), 0.0))
    for a, b, c, d in planes:
        # The length rounded away from the smaller movement, which keeps "surely" true.
        length = isqrt(a * a + b * b + c * c) + 1
        normal = (Fraction(a), Fraction(b), Fraction(c))
        part = exact.clipped(part, exact.halfspace(normal, length * outwards - d), 0)
        if part.dimension < 0:
            return False
    return True


def conditioning(case: Case) -> float:
    """Four times the relative change of the volume when all planes move by half an ulp of the extent."""
    return 4 * HALF_ULP * case.truth.area * case.extent / float(case.truth.volume)


def diameter(part: exact.Polytope) -> float:
    corners = np.array([exact.subtract(exact.coordinates(p), part.centroid) for p in part.vertices], float)
    return float(np.linalg.norm(corners.max(0) - corners.min(0)))


def only_hulls(case: Case) -> bool:
    """Whether the doubles that the core gets are the vertices themselves."""
    return all(isinstance(body, np.ndarray) for body in case.bodies)


def only_polytopes(case: Case) -> bool:
    """Whether the vertices are doubles, or doubles at an exact pose."""
    return not case.round and not any(isinstance(body, Below) for body in case.bodies)


# Single answers


def figures_are_finite(case: Case, found: Overlap) -> str:
    figures = [found.volume, found.volume_error, found.area, *found.inertia.ravel(), *found.gradient.ravel()]
    if found:
        figures += [*found.centroid, *found.vertices.ravel(), *found.bounds.ravel()]
    if len(case.bodies) == 2:
        figures += [found.depth, found.distance, *found.normal]
    return "" if np.isfinite(figures).all() else "a figure is not finite"


def sizes_are_not_negative(case: Case, found: Overlap) -> str:
    return "" if min(found.volume, found.volume_error, found.area) >= 0 else "a volume, area or error is negative"


def the_way_out_agrees_with_the_status(case: Case, found: Overlap) -> str:
    if len(case.bodies) != 2:
        return ""
    signs = {"separated": (True, False), "touching": (False, False), "overlapping": (False, True)}[found.status]
    return (
        ""
        if (found.distance > 0, found.depth > 0) == signs
        else (f"{found.status}, at distance {found.distance} and depth {found.depth}")
    )


def an_overlap_has_a_volume_and_a_surface(case: Case, found: Overlap) -> str:
    return "" if (found.volume > 0 and found.area > 0) == bool(found) else f"{found.status}, with volume {found.volume}"


def a_ball_in_common_is_an_overlap(case: Case, found: Overlap) -> str:
    if case.round:
        return f"{found.status}, with a volume in common" if case.closed_form and not found else ""
    if not found and holds_a_ball(case, NEGLIGIBLE * case.size):
        return f"{found.status}, with a ball in common"
    return ""


def bodies_apart_are_separated(case: Case, found: Overlap) -> str:
    if case.round or case.truth.dimension >= 0 or found.status == "separated":
        return ""
    return f"{found.status}, with a gap" if apart_by(case, NEGLIGIBLE * case.size) else ""


def exact_contact_touches(case: Case, found: Overlap) -> str:
    if case.round or not 0 <= case.truth.dimension < 3 or found.status == "touching":
        return ""
    return f"{found.status}, with a {exact.NAMES[case.truth.dimension]} in common"


def off_volume(case: Case, found: Overlap) -> Offs:
    if case.closed_form is not None:
        return {"volume": (abs(found.volume - case.closed_form), found.volume_error + 4 * HALF_ULP * case.closed_form)}
    return {} if case.round else {"volume": (volume_off(case, found), found.volume_error)}


def the_error_holds_the_volume(case: Case, found: Overlap) -> str:
    return beyond(off_volume(case, found))


def volume_is_as_right_as_its_conditioning(case: Case, found: Overlap) -> str:
    if not measured(case, found):
        return ""
    off, allowed = volume_off(case, found) / case.truth.volume, max(1e-12, conditioning(case))
    return "" if off <= allowed else f"the volume is off by {float(off):.2g} of itself, not {allowed:.2g}"


def volume_of_hulls_is_right_to_twelve_digits(case: Case, found: Overlap) -> str:
    if not measured(case, found) or not only_polytopes(case):
        return ""
    off = float(volume_off(case, found) / case.truth.volume)
    return "" if off <= 1e-12 else f"the volume is off by {off:.2g} of itself"


def volume_of_round_pairs_is_known_to_eleven_digits(case: Case, found: Overlap) -> str:
    """Bodies are exempt if tangent planes enclose their common part, as that of an ellipsoid and a capsule. Special and
    nearly parallel poses have eight digits, as the volume between nearly equal surfaces, or near the plane of a slice,
    may stay open. In special poses and of thin bodies, planes enclose the parts that slices give up."""
    kinds = [type(body.shape) for body in found.shapes]
    others = {*kinds} - {*FLAT, *ROUND}
    enclosed = bool(others) and not (others == {Ellipsoid} and {*kinds} <= {*FLAT, Sphere, Ellipsoid})
    given_up = case.family in ("special_poses", "thin_round") and "dual" in found.way
    if not (case.round and found and len(kinds) == 2) or enclosed or given_up:
        return ""
    less = case.family in ("special_poses", "tilted_round", "thin_round")
    share, most = found.volume_error / found.volume, 1e-8 if less else 1e-11
    return "" if share <= most else f"the volume is known to {share:.3g} of itself, by {found.way}"


def centroid_is_as_right_as_its_conditioning(case: Case, found: Overlap) -> str:
    if not measured(case, found):
        return ""
    off = np.array([Fraction(x) - y for x, y in zip(found.centroid.tolist(), case.truth.centroid)], float)
    size, world = diameter(case.truth), np.linalg.norm(np.spacing(np.abs(found.centroid)))
    beyond = float(np.linalg.norm(off) - world) / size
    allowed = max(1e-12, conditioning(case))
    return "" if beyond <= allowed else f"the centroid is off by {beyond:.2g} of the size, not {allowed:.2g}"


def off_way(case: Case, found: Overlap) -> Offs:
    truth = way_out(case, found)
    if truth is None:
        return {}
    return {
        "depth": (abs(Fraction(found.depth) - max(-truth, Fraction(0))), found.errors.depth),
        "distance": (abs(Fraction(found.distance) - max(truth, Fraction(0))), found.errors.distance),
    }


def the_errors_hold_depth_and_distance(case: Case, found: Overlap) -> str:
    return beyond(off_way(case, found))


def off_witnesses(case: Case, found: Overlap) -> Offs:
    truth = None if found else way_out(case, found)
    if truth is None:
        return {}
    witnesses = [exact.vector(found.witness_a), exact.vector(found.witness_b)]
    between = exact_distance.root(exact_distance.distance_squared(witnesses[:1], witnesses[1:]))
    beside = max(exact_distance.outside(body, w) for body, w in zip(way_bodies(case, found), witnesses, strict=True))
    return {"witnesses": (beside + max(between - max(truth, Fraction(0)), Fraction(0)), found.errors.witnesses)}


def the_error_of_witnesses_holds_them(case: Case, found: Overlap) -> str:
    return beyond(off_witnesses(case, found))


def errors_of_depth_and_distance_are_small(case: Case, found: Overlap) -> str:
    """As small as numbers so large, of the bodies and of their distance, leave them; without rims, to nine digits or
    to a last bit of such numbers. Of bodies that touch, whose depth is stated as none, the true depth is allowed:
    needles that have no ball in common may be deep in each other."""
    if len(case.bodies) != 2:
        return ""
    boxes = [shape.bounds for shape in found.shapes if np.isfinite(shape.bounds).all()]
    world = max(float(np.abs(box).max()) for box in boxes) if boxes else 1.0
    relative = [shape.bounds - found.shapes[0].position for shape in found.shapes]
    extent = sum(float(np.abs(box[np.isfinite(box)]).max(initial=0)) for box in relative)
    far = float(np.linalg.norm(np.subtract(*(shape.position for shape in found.shapes))))
    errors, rims = found.errors, not {type(shape.shape) for shape in found.shapes} <= WITHOUT_RIMS
    numbers = extent + far + found.depth + found.distance
    depth_error = errors.depth
    if found.status == "touching" and depth_error > 1e-14 * numbers and (way := way_out(case, found)) is not None:
        depth_error = max(0.0, depth_error + min(0.0, (1 + 1e-9) * float(way)))
    complaints = [
        f"the error of {name} is {error:.3g}"
        for name, error, size, share in (
            ("depth", depth_error, found.depth, 1e-14),
            ("distance", errors.distance, found.distance, 1e-14),
            ("witnesses", errors.witnesses - 8 * HALF_ULP * world, 0.0, 1e-12),
        )
        if error > max(share, 1e-11 if rims else 0.0) * numbers
        or (size > 0 and not rims and error > max(1e-9 * size, 1e-16 * numbers))
    ]
    return "; ".join(complaints)


def way_bodies(case: Case, found: Overlap) -> list[exact.Polytope | Placed]:
    """The pair as exact_distance takes it."""
    return [
        placed if isinstance(placed.shape, ROUND) else body_of(case, i, placed) for i, placed in enumerate(found.shapes)
    ]


def body_of(case: Case, i: int, placed: Placed) -> exact.Polytope:
    if isinstance(placed.shape, Box):
        corners = CORNERS * placed.shape.half_extents
    elif isinstance(case.bodies[i], Placed):
        corners = placed.shape.vertices
    else:
        return solid(points_of(case.bodies[i]))
    return exact.hull(exact.placed(corners, placed.position, placed.given_orientation))


def way_out(case: Case, found: Overlap) -> Fraction | None:
    """How far a pair is apart, or less than nothing by how deep; None of what is too large, or not known."""
    if len(case.bodies) != 2 or not all(isinstance(shape.shape, (Box, Hull, *ROUND)) for shape in found.shapes):
        return None
    if not case.round and np.prod([len(solid.vertices) for solid in case.solids]) >= 400:
        return None
    return exact_distance.signed_distance(*way_bodies(case, found))


def off_measures(case: Case, found: Overlap) -> Offs:
    if not measured(case, found):
        return {}
    errors, truth = found.errors, case.truth
    inertia = max(abs(Fraction(float(found.inertia[i, j])) - truth.inertia[i][j]) for i in range(3) for j in range(3))
    off: Offs = {
        "area": (abs(found.area - truth.area), errors.area + 8 * HALF_ULP * truth.area),
        "centroid": (length(found.centroid, truth.centroid), errors.centroid),
        "inertia": (inertia, errors.inertia),
        "vertices": (hausdorff_distance_at_least(found, truth), errors.vertices + 8 * HALF_ULP * diameter(truth)),
    }
    for body, (placed, slopes) in enumerate(zip(found.shapes, found.gradient, strict=True)):
        force, moment = slopes_off(truth, body, exact.vector(placed.position), slopes)
        off[f"force on body {body}"] = force, errors.gradient[body, 0]
        off[f"moment on body {body}"] = moment, errors.gradient[body, 3]
    return off


def the_errors_hold_the_measures(case: Case, found: Overlap) -> str:
    return beyond(off_measures(case, found))


def slopes_off(truth: exact.Polytope, body: int, position: exact.Vector, slopes: np.ndarray) -> tuple[float, float]:
    """How far force and moment may be off. A facet that the body shares with others counts or does not, as the volume
    has a slope to one side and another to the other: whichever is farther, along some directions."""
    own = replace(truth, facets=tuple(facet for facet in truth.facets if facet.owners == (body,)))
    shared = [facet for facet in truth.facets if body in facet.owners and facet.owners != (body,)]
    ways_off = []
    for given, sure, parts in (
        (slopes[:3], own.pull(body), [exact.area_vector(facet) for facet in shared]),
        (slopes[3:], own.moment(body, position), [exact.moment_of(facet, position) for facet in shared]),
    ):
        base = np.array([float(Fraction(g) - s) for g, s in zip(given.tolist(), sure, strict=True)])
        along = np.array(parts, float).reshape(-1, 3) @ DIRECTIONS.T
        ways_off.append(max(float(np.linalg.norm(base)), float((base @ DIRECTIONS.T - along.clip(max=0).sum(0)).max())))
    return ways_off[0], ways_off[1]


def hausdorff_distance_at_least(found: Overlap, truth: exact.Polytope) -> float:
    """The distance of the hull of the vertices from the common part, by supports along some directions."""
    ours = np.array([exact.subtract(exact.vector(v), truth.centroid) for v in found.vertices.tolist()], float)
    theirs = np.array([exact.subtract(exact.coordinates(p), truth.centroid) for p in truth.vertices], float)
    return float(np.abs((ours @ DIRECTIONS.T).max(0) - (theirs @ DIRECTIONS.T).max(0)).max())


def length(given: np.ndarray, truth: exact.Vector) -> float:
    return float(np.linalg.norm([float(Fraction(g) - t) for g, t in zip(given.tolist(), truth, strict=True)]))


def errors_of_measures_are_as_small_as_that_of_the_volume(case: Case, found: Overlap) -> str:
    """Three errors may be larger. Coordinates in the world have a rounding of their last bits. Vertices of a drawing
    become one if 512 roundings may separate them. The gradient is open where bodies may share a facet."""
    if not measured(case, found):
        return ""
    errors, size, volume = found.errors, diameter(case.truth), float(case.truth.volume)
    world = 8 * 2 * HALF_ULP * (float(np.linalg.norm(found.centroid)) + size)
    stated = {
        "area": errors.area / case.truth.area,
        "centroid": (errors.centroid - world) / size,
        "inertia": errors.inertia / (volume * size**2),
        "vertices": (errors.vertices - world) / size / 5120,
    }
    beyond = (f"the error of {name} is {error:.3g} of it" for name, error in stated.items() if not error <= 1e-11)
    return "; ".join(beyond)


def measured(case: Case, found: Overlap) -> bool:
    return bool(found) and not case.round and case.truth.dimension == 3


def volume_off(case: Case, found: Overlap) -> Fraction:
    exactly = case.truth.volume if case.truth.dimension == 3 else Fraction(0)
    return abs(Fraction(found.volume) - exactly)


def the_certificate_is_proved(case: Case, found: Overlap) -> str:
    """Within what is stated; of a round body that touches, which it encloses by other planes, beside that and as narrow
    as what their distance may be off by all over their surface."""
    lower, upper = certificate(found).verify()
    volume, error = Fraction(found.volume), Fraction(found.volume_error)
    within = volume - error <= lower <= upper <= volume + error
    other_planes = case.round and found.status == "touching"
    beside = other_planes and lower <= volume + error and volume - error <= upper
    apart = found.errors.distance if found.status == "touching" else None
    film = Fraction(apart) * Fraction(found.errors.area) if apart is not None else 0
    narrow = upper - lower <= max(6 * error, 3 * Fraction(TOLERANCE) * volume, film)
    return "" if within or (beside and narrow) else "the proved bounds are not within the stated ones"


# The same case once more


def the_order_of_bodies_keeps_the_status(case: Case, found: Overlap) -> str:
    again = answer(case.placed[::-1])
    return same_status(found, again) or volumes_agree(found, again)


def the_order_of_bodies_keeps_every_bit(case: Case, found: Overlap) -> str:
    return same_bits(found, answer(case.placed[::-1]), 1.0)


def a_power_of_two_scales_every_bit(case: Case, found: Overlap) -> str:
    if not only_hulls(case):
        return ""
    scale = 2.0 ** (case.seed % 41 - 20)
    again = answer([points * scale for points in case.bodies])
    return same_status(found, again) or same_bits(found, again, scale)


def mirror_image_and_turns_of_the_axes_keep_the_status(case: Case, found: Overlap) -> str:
    if not only_hulls(case):
        return ""
    changes = ("mirrored", lambda p: p * [-1, 1, 1]), ("turned", lambda p: p[:, [1, 2, 0]])
    for name, change in changes:
        again = answer([change(points) for points in case.bodies])
        if complaint := same_status(found, again) or volumes_agree(found, again):
            return f"{name}: {complaint}"
    return ""


def rigid_motion_keeps_the_status(case: Case, found: Overlap) -> str:
    """Unless its rounding may have moved planes by as much as the bodies are deep or apart."""
    if not only_hulls(case):
        return ""
    rng = np.random.default_rng(case.seed)
    matrix, shift = rotation(quaternion(rng)), case.extent * rng.normal(size=3)
    far = case.extent + max(float(np.abs(box).max()) for box in case.boxes) + float(np.linalg.norm(shift))
    moved = NEGLIGIBLE * case.size + 16 * HALF_ULP * far
    if moved > case.size / 16:
        return ""  # it may have flattened a body
    again = answer([mapped(points, matrix) + shift for points in case.bodies])
    if again.status == found.status:
        return ""
    return same_status(found, again) if holds_a_ball(case, moved) or apart_by(case, moved) else ""


def the_volume_moves_no_faster_than_the_bodies(case: Case, found: Overlap) -> str:
    """By less than the area of the smaller body times the way of its fastest point, and the stated errors."""
    if case.moved is None:
        return ""
    after = answer([*case.placed[:-1], case.moved])
    area = min(exact.hull(points).area for points in case.bodies)
    way = float(np.linalg.norm(case.moved - case.bodies[-1], axis=1).max())
    change, errors = abs(after.volume - found.volume), after.volume_error + found.volume_error
    return (
        ""
        if change <= area * way * (1 + 1e-9) + errors
        else f"the volume jumps by {change:.3g} over a way of {way:.3g}"
    )


def a_turn_keeps_the_measures_of_round_bodies(case: Case, found: Overlap) -> str:
    """Both answers agree within the sum of their errors. Bodies are moved a little first, so that the turn is exact,
    and their order is swapped. Slices then lie across other axes and miss other parts."""
    if not case.round or len(case.bodies) != 2:
        return ""
    (one, other), (one_again, other_again), turn = turned_pairs(found.shapes, TURNS[case.seed % len(TURNS)])
    before, after = answer([one, other]), answer([other_again, one_again])
    if not before or not after:
        return ""  # the least that is moved may part them
    inertia = turn.T @ after.inertia @ turn
    centroid = after.centroid @ turn
    size = float(np.linalg.norm(np.ptp(before.bounds, axis=0)))
    last_bits = 16 * HALF_ULP * (size + float(np.linalg.norm(other.position)))
    share = last_bits / size
    errors, again = before.errors, after.errors
    off = {
        "volume": (abs(before.volume - after.volume), errors.volume + again.volume + share * before.volume),
        "area": (abs(before.area - after.area), errors.area + again.area + share * before.area),
        "centroid": (np.linalg.norm(before.centroid - centroid), errors.centroid + again.centroid + last_bits),
        "inertia": (
            np.linalg.norm(before.inertia - inertia, 2),
            3 * (errors.inertia + again.inertia) + share * np.trace(before.inertia),
        ),
    }
    for body in (0, 1):
        for name, at in (("force", slice(0, 3)), ("moment", slice(3, 6))):
            apart = before.gradient[body, at] - after.gradient[1 - body, at] @ turn
            allowed = errors.gradient[body, at.start] + again.gradient[1 - body, at.start]
            lever = 1.0 if name == "force" else size + float(np.linalg.norm(other.position))
            off[f"{name} on body {body}"] = np.linalg.norm(apart), allowed + share * before.area * lever
    beyond = (f"{name} is off by {by:.3g}, not {most:.3g}" for name, (by, most) in off.items() if not by <= most)
    return "; ".join(beyond)


def turned_pairs(shapes: tuple[Placed, ...], turn: tuple[int, ...]) -> tuple[list[Placed], list[Placed], np.ndarray]:
    """A pair about the first body's position, the same turned by a quaternion of whole numbers, and the rotation. So
    that no number is rounded, orientations are to 46 bits, and the second position is a multiple of the square of the
    quaternion's length by which the matrix of the rotation is divided."""
    square = sum(x * x for x in turn)
    matrix = np.rint(square * rotation(turn))
    at = np.subtract(shapes[1].position, shapes[0].position)
    step = to_46_bits(at / square)
    orientations = [to_46_bits(shape.given_orientation) for shape in shapes]
    places = [np.zeros(3), step * square], [np.zeros(3), matrix @ step]
    turns = orientations, [product(turn, q) for q in orientations]
    one, other = (
        [Placed(shape.shape, *pose) for shape, *pose in zip(shapes, where, how, strict=True)]
        for where, how in zip(places, turns, strict=True)
    )
    return one, other, matrix / square


def to_46_bits(values: np.ndarray) -> np.ndarray:
    """Values rounded to 46 bits of the largest."""
    return coarse(values, 46 - int(np.frexp(np.abs(values).max())[1]))


TURNS = (
    (1, 2, 2, 0),
    (2, -1, 0, 2),
    (0, 1, 2, -2),
    (2, 1, -1, 1),
    (1, -2, 1, 1),
    (3, 1, 1, 0),
    (1, 1, 0, -3),
    (-1, 3, 2, 1),
)


def same_status(one: Overlap, other: Overlap) -> str:
    return "" if one.status == other.status else f"{one.status} becomes {other.status}"


def same_bits(one: Overlap, other: Overlap, scale: float) -> str:
    powers = {"volume": 3, "volume_error": 3, "area": 2, "centroid": 1}
    for name, power in powers.items():
        before, after = getattr(one, name), getattr(other, name)
        if before is not None and np.any(np.asarray(before) * scale**power != after):
            return f"{name} {before!r} becomes {np.asarray(after) / scale**power!r}"
    return ""


def volumes_agree(one: Overlap, other: Overlap) -> str:
    agree = abs(one.volume - other.volume) <= one.volume_error + other.volume_error
    return "" if agree else f"volume {one.volume} becomes {other.volume}"


UNPROVED: tuple[Rule, ...] = (
    figures_are_finite,
    sizes_are_not_negative,
    the_way_out_agrees_with_the_status,
    an_overlap_has_a_volume_and_a_surface,
    a_ball_in_common_is_an_overlap,
    bodies_apart_are_separated,
    exact_contact_touches,
    the_error_holds_the_volume,
    volume_is_as_right_as_its_conditioning,
    volume_of_hulls_is_right_to_twelve_digits,
    volume_of_round_pairs_is_known_to_eleven_digits,
    centroid_is_as_right_as_its_conditioning,
    the_errors_hold_depth_and_distance,
    the_error_of_witnesses_holds_them,
    errors_of_depth_and_distance_are_small,
    the_errors_hold_the_measures,
    errors_of_measures_are_as_small_as_that_of_the_volume,
    the_order_of_bodies_keeps_the_status,
    the_order_of_bodies_keeps_every_bit,
    a_power_of_two_scales_every_bit,
    mirror_image_and_turns_of_the_axes_keep_the_status,
    rigid_motion_keeps_the_status,
    a_turn_keeps_the_measures_of_round_bodies,
    the_volume_moves_no_faster_than_the_bodies,
)
RULES: tuple[Rule, ...] = (*UNPROVED, the_certificate_is_proved)


def complaints(case: Case, found: Overlap, rules: tuple[Rule, ...] = RULES) -> Iterator[tuple[str, str]]:
    """The rules that are broken, by name, and how. An exception breaks a rule too."""
    for rule in rules:
        try:
            complaint = rule(case, found)
        except Exception as error:
            complaint = f"{type(error).__name__}: {error}"
        if complaint:
            yield rule.__name__, complaint
