"""Links and elastic patches by another route than the core's contact solver takes: velocities are differences of poses,
a patch is four springs, and laws are looked at where the solver ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from overlapper import Overlap, Placed, _core, overlap, overlaps

REVOLUTE, PRISMATIC, SPHERICAL = 1, 2, 3
COORDINATES = {0: 0, REVOLUTE: 1, PRISMATIC: 1, SPHERICAL: 3}
REACH = np.sqrt(3)  # radii of gyration that the centre of pressure may be off the centre of a patch
STEP = 1e-5  # of differences, whose error is about 1e-10


@dataclass(frozen=True)
class Link:
    parent: int = -1
    joint: int = 0
    axis: Sequence[float] = (0, 0, 0)
    pivot: Sequence[float] = (0, 0, 0)
    mass: float = 1.0
    inertia: Sequence[float] = (1, 1, 1)


@dataclass(frozen=True)
class Links:
    """Links at poses: (n, 3) positions and (n, 4) quaternions of their inertial frames."""

    links: Sequence[Link]
    positions: np.ndarray
    orientations: np.ndarray

    def solver(self) -> _core.ContactSolver:
        names = ("parent", "joint", "axis", "pivot", "mass", "inertia")
        return _core.ContactSolver(*([getattr(link, name) for link in self.links] for name in names))

    @property
    def frames(self) -> list[tuple[np.ndarray, np.ndarray]]:
        return [*zip(self.positions, self.orientations, strict=True)]

    @cached_property
    def turns(self) -> Rotation:
        return Rotation.from_quat(self.orientations)

    @property
    def base_of(self) -> list[int]:
        bases: list[int] = []
        for i, link in enumerate(self.links):
            bases.append(i if link.parent < 0 else bases[link.parent])
        return bases

    @property
    def coordinates(self) -> list[tuple[int, int]]:
        """By coordinate: the link that it moves with all that hangs on it, and which coordinate of that link it is."""
        counts = [6 if link.parent < 0 else COORDINATES[link.joint] for link in self.links]
        return [(i, k) for i, count in enumerate(counts) for k in range(count)]

    def hangs_on(self, link: int, other: int) -> bool:
        while link not in (other, -1):
            link = self.links[link].parent
        return link == other

    def moved(self, coordinate: tuple[int, int], by: float) -> Links:
        """The links after one coordinate has moved."""
        at, k = coordinate
        link, positions, orientations = self.links[at], self.positions.copy(), self.orientations.copy()
        if link.parent < 0:
            pivot, axis, shifts = positions[at], np.eye(3)[k % 3], k < 3
        else:
            parent = self.turns[link.parent]
            pivot, shifts = positions[link.parent] + parent.apply(link.pivot), link.joint == PRISMATIC
            axis = self.turns[at].apply(np.eye(3)[k]) if link.joint == SPHERICAL else parent.apply(link.axis)
        hanging = [i for i in range(len(self.links)) if self.hangs_on(i, at)]
        if shifts:
            positions[hanging] += axis * by
        else:
            turn = Rotation.from_rotvec(axis * by)
            positions[hanging] = pivot + turn.apply(positions[hanging] - pivot)
            orientations[hanging] = (turn * self.turns[hanging]).as_quat()
        return replace(self, positions=positions, orientations=orientations)

    def after(self, duration: float, velocity: np.ndarray) -> tuple[np.ndarray, Rotation]:
        """Where links are after a duration in which all coordinates keep their velocity, and how they have turned."""
        positions, turns = self.positions.copy(), [Rotation.identity()] * len(self.links)
        owners = np.array([at for at, _ in self.coordinates])
        for i, link in enumerate(self.links):
            own, parent = duration * velocity[owners == i], link.parent
            if parent < 0:
                positions[i] += own[:3]
                turns[i] = Rotation.from_rotvec(own[3:])
                continue
            frame = self.turns[parent]
            axes = self.turns[i].as_matrix().T if link.joint == SPHERICAL else [frame.apply(link.axis)]
            by = own @ axes if len(own) else np.zeros(3)
            joint = Rotation.from_rotvec(np.zeros(3) if link.joint == PRISMATIC else by)
            pivot = self.positions[parent] + frame.apply(link.pivot)
            moved = pivot + joint.apply(self.positions[i] - pivot) + (by if link.joint == PRISMATIC else 0)
            positions[i] = positions[parent] + turns[parent].apply(moved - self.positions[parent])
            turns[i] = turns[parent] * joint
        return positions, Rotation.concatenate(turns)

    @cached_property
    def nearby(self) -> list[tuple[Links, Links]]:
        """By coordinate: the links a little before and a little after."""
        return [(self.moved(each, -STEP), self.moved(each, STEP)) for each in self.coordinates]

    def jacobian(self, link: int, point: np.ndarray) -> np.ndarray:
        """(6, c): how fast a point of a link moves and turns by each coordinate."""
        local = self.turns[link].inv().apply(point - self.positions[link])
        before, after = (Rotation.from_quat([pair[i].orientations[link] for pair in self.nearby]) for i in (0, 1))
        at_before, at_after = (np.array([pair[i].positions[link] for pair in self.nearby]) for i in (0, 1))
        linear = at_after + after.apply(local) - at_before - before.apply(local)
        return np.hstack([linear, (after * before.inv()).as_rotvec()]).T / (2 * STEP)

    def inverse_mass(self) -> np.ndarray:
        """From the kinetic energy of all links. Bases without mass stand still, and so do joints that move no mass."""
        coordinates = self.coordinates
        mass = np.zeros((len(coordinates),) * 2)
        for i, link in enumerate(self.links):
            if link.mass > 0:
                rows, turn = self.jacobian(i, self.positions[i]), self.turns[i].as_matrix()
                mass += link.mass * rows[:3].T @ rows[:3]
                mass += rows[3:].T @ (turn @ np.diag(link.inertia) @ turn.T) @ rows[3:]
        held = [self.links[at].parent < 0 and not self.links[at].mass > 0 for at, _ in coordinates]
        free = np.flatnonzero(~np.array(held) & (np.diag(mass) > 1e-12 * np.diag(mass).max()))
        inverse = np.zeros_like(mass)
        inverse[np.ix_(free, free)] = np.linalg.inv(mass[np.ix_(free, free)])
        return inverse

    def movable(self, base: int) -> bool:
        own = [link for link, at in zip(self.links, self.base_of) if at == base]
        return own[0].mass > 0 or any(COORDINATES[link.joint] for link in own[1:])


@dataclass(frozen=True)
class Patch:
    """Four springs that stand for the patch between two shapes, seen along its area vector. They have the area, the
    centre and the second moments of the patch. There are no springs if the area vector has no direction."""

    found: Overlap
    stiffness: float
    dissipation: float
    friction: float

    @property
    def directed(self) -> bool:
        return bool(self.found) and np.linalg.norm(self.found.patch_area) > 1e-6 * self.found.area

    @property
    def area(self) -> float:
        return float(np.linalg.norm(self.found.patch_area)) if self.directed else 0.0

    @property
    def normal(self) -> np.ndarray:
        return self.found.patch_area / self.area if self.directed else self.found.normal

    @property
    def force(self) -> float:
        return self.stiffness * self.found.volume

    @property
    def centre(self) -> np.ndarray:
        """From the centroid of the volume."""
        return self.found.patch_centre - self.found.centroid

    @property
    def radii(self) -> tuple[np.ndarray, np.ndarray]:
        """Radii of gyration (2,) and their axes (2, 3)."""
        squares, axes = np.linalg.eigh(self.found.patch_moments / self.area)
        flat = np.argsort(np.abs(axes.T @ self.normal))[:2]
        return np.sqrt(squares[flat].clip(0)), axes.T[flat]

    @property
    def springs(self) -> np.ndarray:
        """(4, 3) from the centroid; each has a quarter of the area."""
        if not self.directed:
            return np.zeros((0, 3))
        offsets = np.sqrt(2) * self.radii[0][:, None] * self.radii[1]
        return self.centre + np.vstack([offsets, -offsets])

    def pressed(self, slip: np.ndarray) -> np.ndarray:
        """The wrench (6,) about the centroid by which springs answer a displacement (6,)."""
        arms = self.springs
        if not len(arms):
            return np.zeros(6)
        way = (slip[:3] + np.cross(slip[3:], arms)) @ self.normal
        forces = -self.stiffness * self.area / 4 * way[:, None] * self.normal
        return np.concatenate([forces.sum(0), np.cross(arms, forces).sum(0)])

    def within_reach(self, wrench: np.ndarray) -> tuple[bool, np.ndarray]:
        """Whether the centre of that pressure is on the patch, and where, from the centroid; drawn back, if it is not.
        Torques without a force that pushes are those of one infinitely far away."""
        force = float(wrench[:3] @ self.normal)
        off = np.cross(self.normal, wrench[3:]) - max(force, 0.0) * self.centre
        radii, axes = self.radii
        far = float(np.linalg.norm(axes @ off / radii))
        if force > 0 and far <= REACH * force:
            return True, self.centre + off / force
        return False, self.centre + (off * REACH / far if far > 0 else 0)

    def points(self) -> tuple[np.ndarray, np.ndarray]:
        """The points of distributed friction, (16, 3) from the centroid, and their shares of the pressure."""
        nodes, weights = np.polynomial.legendre.leggauss(4)
        radii, axes = self.radii
        grid = np.stack(np.meshgrid(nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 2)
        offsets = np.sqrt(3) * (grid * radii) @ axes
        plain = np.outer(weights, weights).ravel() / 4
        reach = plain @ np.linalg.norm(self.centre + offsets, axis=1)
        slope = -axes.T @ (axes @ self.centre / radii**2)
        share = plain * (1 + offsets @ slope).clip(0)
        return self.centre + offsets * self.found.patch_distance / reach, share / share.sum()


@dataclass(frozen=True)
class Scene:
    """A step of links whose shapes overlap: shape i is on link `on[i]`, at its own pose."""

    links: Links
    shapes: Sequence[Placed]
    on: Sequence[int]
    pairs: Sequence[tuple[int, int]]
    stiffness: float = 1e5
    dissipation: float = 1e-3
    friction: float = 0.5
    duration: float = 1 / 240
    velocity: Any = 0.0
    acceleration: Any = 0.0
    damped: bool = False
    distributed: bool = False
    motors: Any = None  # rows of coordinate, target, gain and limit
    rounds: int = 1  # how often it is solved, each time from the answer before
    solver: _core.ContactSolver = field(init=False)
    frequency2: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        count = len(self.links.coordinates)
        for name in ("velocity", "acceleration"):
            object.__setattr__(self, name, np.broadcast_to(np.asarray(getattr(self, name), float), (count,)))
        object.__setattr__(self, "solver", self.links.solver())
        object.__setattr__(self, "frequency2", self.place(self.solver))

    def place(self, solver: _core.ContactSolver) -> np.ndarray:
        shapes = [each.shape for each in self.shapes]
        poses = [each.position for each in self.shapes], [each.given_orientation for each in self.shapes]
        found = overlaps(shapes, *poses, np.array(self.pairs, dtype=np.int32).reshape(-1, 2))
        each = np.ones(len(self.pairs))
        given = (each * self.stiffness, each * self.dissipation, each * self.friction)
        return solver.place(self.links.frames, found, np.array(self.on), *given)

    def solve(self) -> Solution:
        damped = np.full(len(self.pairs), self.damped)
        for _ in range(self.rounds):
            told = self.solver.solve(
                self.duration, self.velocity, self.acceleration, damped, self.distributed, motors=self.motors
            )
        return Solution(self, *told)

    def patches(self) -> list[Patch]:
        given = self.stiffness, self.dissipation, self.friction
        return [Patch(overlap(self.shapes[a], self.shapes[b]), *given) for a, b in self.pairs]

    def jacobian(self, pair: tuple[int, int], at: np.ndarray) -> np.ndarray:
        """(6, c): the velocity of the first shape's link over the second's."""
        one, other = (self.links.jacobian(self.on[shape], at) for shape in pair)
        return one - other

    def drift(self, pair: tuple[int, int], at: np.ndarray, staying: float) -> np.ndarray:
        """(6,) the mean slip of a step at constant velocities, less that at its beginning."""
        h, links = self.duration, self.links
        on = [self.on[shape] for shape in pair]
        spins = [(links.jacobian(link, at) @ self.velocity)[3:] for link in on]
        first = np.linalg.norm(spins[0]) >= np.linalg.norm(spins[1])  # turns more, and is carried by the other
        other, carrier = on if first else on[::-1]
        (spin, around), sign = (spins, 1) if first else (spins[::-1], -1)
        positions, turns = links.after(h, self.velocity)
        carried = positions[carrier] + turns[carrier].apply(links.positions[other] - links.positions[carrier])
        arm, beside = at - links.positions[other], spin - around
        turning = np.cross(around, np.cross(beside, arm)) + staying * np.cross(beside, np.cross(spin, arm))
        mean = (positions[other] - carried) / h + np.cross(beside, arm) + h / 2 * turning
        turned = (turns[on[0]].as_rotvec() - turns[on[1]].as_rotvec()) / h
        return np.concatenate([sign * mean, turned]) - self.jacobian(pair, at) @ self.velocity


@dataclass(frozen=True)
class Solution:
    scene: Scene
    force: np.ndarray
    torque: np.ndarray
    slip: np.ndarray
    normal: np.ndarray
    directed: np.ndarray
    on_links: np.ndarray
    constraints: np.ndarray
    acceleration: np.ndarray
    sweeps: int
    residual: float

    @property
    def velocity(self) -> np.ndarray:
        """At the end of the step."""
        scene = self.scene
        return scene.velocity + scene.duration * (scene.acceleration + self.acceleration)


def broken_laws(found: Solution, tolerance: float = 1e-8, staying: float = 0) -> list[str]:
    """The laws of mechanics that a solution does not keep, as complaints.

    `staying` is the share of the spins that moves surfaces away from the contacts, which the step before tells.
    """
    scene, links = found.scene, found.scene.links
    inverse = links.inverse_mass()
    complaints = []

    def ask(law: str, given: Any, truth: Any, scale: float) -> None:
        off = float(np.abs(np.subtract(given, truth)).max(initial=0))
        if not off <= tolerance * scale:
            complaints.append(f"{law}: {given} for {truth}")

    # Newton's law: forces on links move coordinates, and are what patches give and take.
    size = float(np.abs(found.force).sum()) + 1e-300
    fastest = float(np.abs(scene.velocity).max() + scene.duration * np.abs(scene.acceleration).max())
    jacobians = [links.jacobian(i, links.positions[i]) for i in range(len(links.links))]
    moved = inverse @ sum(rows.T @ wrench for rows, wrench in zip(jacobians, found.on_links, strict=True))
    moved, answers = driven(found, moved, inverse, ask)
    ask("acceleration", found.acceleration, moved, float(np.abs(moved).max()))
    on_links = np.zeros_like(found.on_links)
    swings: dict[int, float] = {}
    patches = scene.patches()
    for pair, patch, force, torque in zip(scene.pairs, patches, found.force, found.torque, strict=True):
        for shape, sign in zip(pair, (1, -1), strict=True):
            if patch.found:
                arm = patch.found.centroid - links.positions[scene.on[shape]]
                on_links[scene.on[shape]] += sign * np.concatenate([force, torque + np.cross(arm, force)])
    ask("forces on links", found.on_links, on_links, size)

    for i, (pair, patch) in enumerate(zip(scene.pairs, patches, strict=True)):
        if not patch.found:
            ask("bodies apart", [*found.force[i], *found.torque[i]], 0, size)
            continue
        normal = found.normal[i]
        if patch.directed:
            ask("normal", normal, patch.normal, 1e-4)
        rows = scene.jacobian(pair, patch.found.centroid)
        mobility = rows @ answers @ rows.T
        before, after = rows @ scene.velocity, rows @ found.velocity
        speed = fastest + scene.duration * size * float(np.abs(mobility).max())
        along = np.eye(3) - np.outer(normal, normal)
        mean = after + scene.drift(pair, patch.found.centroid, staying)
        ask("slip", found.slip[i], along @ mean[:3], speed)

        # Pressures: the springs' answer at the end of the step, or what of it lies on the patch.
        pressure = np.concatenate([normal * (found.force[i] @ normal), along @ found.torque[i]])
        lead = scene.duration * (1 if scene.damped else 0.25)
        begin = np.concatenate([normal * patch.force, np.zeros(3)])
        begin = begin - (0 if scene.damped else lead) * patch.pressed(before)
        springs = (lead + patch.dissipation) * np.column_stack([patch.pressed(unit) for unit in np.eye(6)])
        normal_part = np.zeros((6, 6))
        normal_part[:3, :3], normal_part[3:, 3:] = np.outer(normal, normal), along
        free = after - scene.duration * mobility @ pressure
        asked = np.linalg.solve(
            np.eye(6) - scene.duration * springs @ normal_part @ mobility @ normal_part, begin + springs @ free
        )
        scale = max(size, float(np.abs(asked).max()))
        swing = (
            np.linalg.eigvals(-springs / (lead + patch.dissipation) @ (rows @ inverse @ rows.T)).real.max()
            if patch.directed
            else 0
        )
        for base in {links.base_of[scene.on[shape]] for shape in pair}:
            swings[base] = swings.get(base, 0.0) + max(0.0, swing)
        on_patch, at = patch.within_reach(asked) if patch.directed else (True, np.zeros(3))
        if on_patch and asked[:3] @ normal > 0:
            ask("pressure", pressure, asked, scale)
        else:
            pushed = max(0.0, float((begin + springs @ after)[:3] @ normal))
            ask("pressure that is drawn back", pressure[:3], normal * pushed, scale)
            ask("torque of a pressure that is drawn back", pressure[3:], np.cross(at, pressure[:3]), scale)

        # Friction: of all that is allowed, what takes away the most energy.
        limit = patch.friction * float(found.force[i] @ normal)
        sliding, spin = along @ mean[:3], float(normal @ mean[3:])
        drag, twist = along @ found.force[i], float(normal @ found.torque[i])
        power = float(drag @ sliding) + twist * spin
        if scene.distributed and patch.directed:
            arms, shares = patch.points()
            there = sliding + spin * np.cross(normal, arms)
            speeds = np.linalg.norm(there, axis=1)
            ask("power of friction", power, -limit * shares @ speeds, scale * speed)
            ask("friction within its limit", max(0.0, float(np.linalg.norm(drag)) - limit), 0, scale)
            round_patch = np.ptp(patch.radii[0]) < 1e-6 * patch.radii[0].sum()  # whose points may be turned at will
            if speeds.min() > 1e-2 * fastest and not round_patch:
                each = -limit * (shares / speeds)[:, None] * there
                ask("friction that slides", drag, each.sum(0), scale)
                ask("spin that slides", twist, np.cross(arms, each).sum(0) @ normal, scale)
        else:
            distance = patch.found.patch_distance if patch.directed else 0.0
            slips = np.array([*sliding, distance * spin])
            forces = np.array([*drag, twist / distance if distance > 0 else 0.0])
            ask("friction within its limit", max(0.0, float(np.linalg.norm(forces)) - limit), 0, scale)
            ask("power of friction", power, -limit * float(np.linalg.norm(slips)), scale * speed)
            if np.linalg.norm(slips) > 1e-3 * fastest:
                ask("friction that slides", forces, -limit * slips / np.linalg.norm(slips), scale)
            if not distance > 0:
                ask("spin of what has no width", twist, 0, scale)

    ask("frequency", scene.frequency2, highest_swings(scene, swings), max(swings.values(), default=0.0))
    return complaints


def driven(
    found: Solution, moved: np.ndarray, inverse: np.ndarray, ask: Callable[[str, Any, Any, float], None]
) -> tuple[np.ndarray, np.ndarray]:
    """Ask for the laws of motors, beside what patches have `moved`.

    Returns the acceleration by patches and motors, and the answer of coordinates with motors to forces.
    """
    scene, h = found.scene, found.scene.duration
    if scene.motors is None:
        return moved, inverse
    coordinates, targets, gains, limits = np.array(scene.motors, dtype=float).T
    which, gains = coordinates.astype(int), np.maximum(gains, 1e-6)
    mobility = inverse[np.ix_(which, which)]
    missing = (found.acceleration - moved)[which]
    pushes = np.linalg.solve(mobility, missing)
    # A motor alone would change a velocity v without it to (1 - gain) v + target.
    wished = (targets - gains * found.velocity[which]) / np.diag(mobility) / h
    soft, scale = 1 - gains, float(np.abs(pushes).max() + np.abs(limits).min())
    full = np.abs(pushes) > limits * (1 - 1e-6)
    ask("motors within their limits", np.maximum(np.abs(pushes) - limits, 0), 0, scale)
    ask("motors that suffice", (wished - soft * pushes)[~full], 0, float(np.abs(wished).max() + scale))
    ask("motors at their limits", np.minimum(np.sign(pushes) * (wished - soft * pushes), 0)[full], 0, scale)
    held, gain = which[~full], gains[~full]
    own = inverse[np.ix_(held, held)]
    stiff = np.linalg.inv(own + np.diag(np.diag(own) * (1 - gain) / gain))
    return moved + inverse[:, which] @ pushes, inverse - inverse[:, held] @ stiff @ inverse[held]


def highest_swings(scene: Scene, swings: dict[int, float]) -> list[float]:
    """For each pair the highest of the `swings` of its bases that can move."""
    links = scene.links
    bases = [{links.base_of[scene.on[shape]] for shape in pair} for pair in scene.pairs]
    return [max((swings.get(base, 0.0) for base in each if links.movable(base)), default=0.0) for each in bases]
