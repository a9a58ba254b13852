"""The laws of the patches between two links in one step, as equations that the solution satisfies.

The core solves these laws (overlapper/native/forces/pressure.cpp, friction.cpp and contact_solver.cpp). Here they are
written again as residuals of complex numbers, so that complex steps find their derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from overlapper.simulation.forces.moving_patch import Geometry, dot, norm, plane_axes
from overlapper.simulation.forces.trees import turned_by
from overlapper.simulation.model import Array

# As in pressure.cpp: squared radii of gyration within which pressures have their centre, and the slowest impact in m/s.
REACH2, IMPACT = 3.0, 0.2

# Unknowns of a patch: a force and two torques of pressures, two torques against rolling, and friction's two forces and
# torque, all along the axes of the patch. So many residuals.
UNKNOWNS = 8

# A law at its kink within this share of its scale is reported, as derivatives differ on the two sides.
KINK = 1e-7

# A smaller share of the scale of a pressure is rounding of an open contact.
NONE = 1e-12

# Where surfaces turn by less than this share of the speeds of the step, nobody knows where the contact moves.
STILL = 1e-8


class Inputs(NamedTuple):
    """What the laws of the patches between two links depend on. The leading axis is of directions.

    Motions of links are linear at the centre of mass, then angular, in the world: those of a, then those of b. There
    are g patches.
    """

    centres: Any  # (d, 2, 3) m, the centres of mass
    geometry: Any  # (d, g, 29) see `Geometry`
    planes: Any  # (d, g, 2, 3) a point and the normal of the half-space of a patch; zeros without one
    admittance: Any  # (d, 12, 12) the motions of both links by forces and torques on them for 1 s
    before: Any  # (d, 12) at the beginning of the step
    mean: Any  # (d, 12) by which the links would move, if coordinates kept their velocities
    after: Any  # (d, 12) at the end of the step
    unknowns: Any  # (d, g, 8)
    stiffness: Any  # (d, g) Pa/m
    friction: Any  # (d, g)


@dataclass(frozen=True)
class Fixed:
    """The numbers of the patches (g,) between two links that derivatives are not asked for."""

    duration: float
    dissipation: Array
    recovery: Array
    restitution: Array
    rolling: Array
    spinning: Array
    hardening: Array
    directed: Any  # (g,) whether there is an area
    normal: Array  # (g, 3) for those without an area
    damped: Any  # (g,) whether backward Euler is used
    history: Array  # (g, 6) see `ContactSolver.before`
    speed: float  # m/s, of the whole step: what is much less is rounding


@dataclass
class Regimes:
    """Which branch of each law holds, found at the solution, and the kinks (patch, reason) that are near."""

    pressing: Any = None
    drawn: Any = None
    sliding: Any = None
    turning: Any = None  # of rolling resistance
    bouncing: Any = None  # where an impact aims at a speed
    at_depth: Any = None  # where the depth gives back more than that
    carrier: int = 0
    staying: Any = None  # (g,) 'still', 'last', or 'moved'
    clamped: Any = None  # (g,) twice: by which part tipping is damped, and surfaces turn away; NaN if it varies
    kinks: list[tuple[int, str]] = field(default_factory=list)


class Answer(NamedTuple):
    """Residuals (d, g, 8), and forces and torques (d, 12) on the links about their centres of mass."""

    residual: Any
    wrench: Any
    force: Any  # (d, g, 3) N, on a
    torque: Any  # (d, g, 3) N m, on a about the centroid


class LinkLaws:
    """The laws of the patches between two links."""

    def __init__(self, fixed: Fixed) -> None:
        self.fixed = fixed
        self.regimes = Regimes()
        self._along: Array | None = None  # (g, 3) the first axis in each plane

    def __call__(self, given: Inputs, find: bool = False) -> Answer:
        """Return what the laws miss. With `find`, the branches are those of this solution, a single direction."""
        f, regimes = self.fixed, self.regimes
        h = f.duration
        of = Geometry.of(given.geometry)
        area, normal, along, across = self._axes(of)
        centroid = of.centroid

        def slips(motion: Any) -> Any:
            """(d, g, 6) of a over b at the centroids: normal and about two axes, then along these and about."""
            at = [motion[:, None, 6 * k : 6 * k + 3] for k in range(2)]
            spins = [motion[:, None, 6 * k + 3 : 6 * k + 6] for k in range(2)]
            points = [at[k] + np.cross(spins[k], centroid - given.centres[:, k, None]) for k in range(2)]
            linear, angular = points[0] - points[1], spins[0] - spins[1]
            return local(linear, angular)

        def local(linear: Any, angular: Any) -> Any:
            return np.stack(
                [
                    dot(normal, linear),
                    dot(along, angular),
                    dot(across, angular),
                    dot(along, linear),
                    dot(across, linear),
                    dot(normal, angular),
                ],
                axis=-1,
            )

        before, after = slips(given.before), slips(given.after)
        foundation, rest = self._foundation(given, of, area, normal, along, across)
        drift, kept = self._drift(given, of, local, find)
        shares = self._shares(area, of, normal, given.stiffness, rest[..., 0])  # (d, g, g) of the damping
        weights = shares.sum(axis=-1)
        factor = np.where(weights == 0, 0, weights)
        parted = np.where(factor == 0, 1, factor)[..., None]
        approach = np.einsum("dij,dj->di", shares / parted, before[..., 0])
        staying = np.einsum("dij,dj->di", shares / parted, kept)
        more = np.einsum("dij,dj->di", shares, after[..., 0]) - factor * after[..., 0]
        lead = np.where(f.damped, 1.0, 0.25) * h
        response = (lead + staying * (h - lead) + f.dissipation)[..., None, None] * foundation
        response[..., 0, 0] += factor
        known = np.where(f.damped, 0.0, lead)[..., None] * np.einsum("dgij,dgj->dgi", foundation, before[..., :3])
        target = rest + known
        if find:
            asked = -f.restitution * response[0, :, 0, 0].real * approach[0].real
            impact = (f.restitution > 0) & (approach[0].real < -IMPACT) & (factor[0].real > 0)
            regimes.bouncing = impact & (asked > rest[0, :, 0].real)
            self._kink("impact", (f.restitution > 0) & (np.abs(approach[0].real + IMPACT) < KINK * IMPACT))
            self._kink("impact", impact & (np.abs(asked - rest[0, :, 0].real) < KINK * asked))
            regimes.at_depth = impact & ~regimes.bouncing
        bounce = -f.restitution * response[..., 0, 0] * approach
        target[..., 0] = np.where(regimes.bouncing, bounce, np.where(regimes.at_depth, rest[..., 0], target[..., 0]))
        target = target - np.einsum("dgij,dgj->dgi", response, after[..., :3])
        target[..., 0] -= more
        unknowns = given.unknowns
        pressure, rolling, friction = unknowns[..., :3], unknowns[..., 3:5], unknowns[..., 5:]
        pressed = self._pressed(given, of, target, response, pressure, area, normal, along, across, find)
        residual = np.zeros(unknowns.shape, dtype=unknowns.dtype)
        residual[..., :3] = np.where(regimes.pressing[:, None], pressure - pressed, pressure)
        slip = after[..., 3:] + drift
        distance = np.where(f.directed, of.distance, 0.0)
        rubs = f.directed & (given.friction.real > 0)
        distance = distance + np.where(rubs, f.spinning / np.where(rubs, given.friction, 1.0), 0.0)
        limit = given.friction * pressure[..., 0]
        residual[..., 5:] = self._coulomb("sliding", friction, slip, distance, limit, find)
        roll = np.concatenate([after[..., 1:3], np.zeros_like(after[..., :1])], axis=-1)
        against = np.concatenate([rolling, np.zeros_like(rolling[..., :1])], axis=-1)
        limit = f.rolling * pressure[..., 0]
        residual[..., 3:5] = self._coulomb(
            "turning", against, roll, np.where(f.directed, of.distance, 0.0), limit, find
        )[..., :2]
        found = self._wrench(given, (normal, along, across))
        return found._replace(residual=residual)

    @property
    def at_edge(self) -> bool:
        """Whether the pressures of a patch are drawn back to its edge."""
        return bool((self.regimes.pressing & self.regimes.drawn & self.fixed.directed).any())

    def wrench(self, given: Inputs) -> Answer:
        """Return forces and torques without residuals."""
        return self._wrench(given, self._axes(Geometry.of(given.geometry))[1:])

    def _axes(self, of: Geometry) -> tuple[Any, Any, Any, Any]:
        """The area (d, g), the normal (d, g, 3) and two axes in the plane."""
        f = self.fixed
        area = np.where(f.directed, norm(np.where(f.directed[:, None], of.area, 1.0)), 0.0)
        normal = np.where(f.directed[:, None], of.area / np.where(f.directed, area, 1.0)[..., None], f.normal)
        if self._along is None:
            # Rounding must not choose other axes for the next call.
            self._along = plane_axes(normal[0].real)[0]
        return (area, normal, *plane_axes(normal, self._along))

    def _wrench(self, given: Inputs, axes: tuple[Any, Any, Any]) -> Answer:
        normal, along, across = axes
        unknowns, centroid = given.unknowns, Geometry.of(given.geometry).centroid
        pressure, rolling, friction = unknowns[..., :3], unknowns[..., 3:5], unknowns[..., 5:]
        force = pressure[..., :1] * normal + friction[..., :1] * along + friction[..., 1:2] * across
        about = pressure[..., 1:] + rolling
        torque = about[..., :1] * along + about[..., 1:] * across + friction[..., 2:] * normal
        wrenches = []
        for k, sign in enumerate((1, -1)):
            moment = torque + np.cross(centroid - given.centres[:, k, None], force)
            wrenches += [sign * force.sum(axis=1), sign * moment.sum(axis=1)]
        return Answer(unknowns, np.concatenate(wrenches, axis=-1), force, torque)

    def start(self, force: Array, torque: Array, given: Inputs) -> Array:
        """Return (g, 8) the unknowns of known forces (g, 3) and torques (g, 3). Rolling resistance is not split off."""
        normal, along, across = (each[0] for each in self._axes(Geometry.of(given.geometry))[1:])
        turn = [dot(along, torque), dot(across, torque)]
        none = np.zeros(len(force))
        rubbed = [dot(along, force), dot(across, force), dot(normal, torque)]
        rolls = self.fixed.rolling > 0
        return np.stack(
            [dot(normal, force), *(np.where(rolls, none, each) for each in turn)]
            + [np.where(rolls, each, none) for each in turn]
            + rubbed,
            axis=-1,
        )

    def _kink(self, reason: str, where: Any) -> None:
        self.regimes.kinks += [(int(k), reason) for k in np.flatnonzero(where)]

    def _foundation(
        self, given: Inputs, of: Geometry, area: Any, normal: Any, along: Any, across: Any
    ) -> tuple[Any, Any]:
        """Stiffness (d, g, 3, 3) of the foundation, and the pressures (d, g, 3) at rest."""
        f, k = self.fixed, given.stiffness
        directed = f.directed
        to = np.where(directed[:, None], of.centre - of.centroid, 0.0)
        u, v = dot(to, along), dot(to, across)

        def seen(moments: Any, one: Any, two: Any) -> Any:
            return np.einsum("dgi,dgij,dgj->dg", one, moments, two)

        moments = np.where(directed[:, None, None], of.moments, 0.0)
        uu = seen(moments, along, along) + area * u * u
        uv = seen(moments, along, across) + area * u * v
        vv = seen(moments, across, across) + area * v * v
        size, first_u, first_v = area, area * u, area * v
        rest = [k * of.volume, np.zeros_like(area * k), np.zeros_like(area * k)]
        hard = f.hardening > 0
        if hard.any():
            spread, c = np.where(hard[:, None, None], of.spread, 0.0), f.hardening
            point, out = given.planes[:, :, 0], given.planes[:, :, 1]
            depth = np.where(hard, dot(point - of.centroid, out), 0.0)
            turned = np.einsum("dgij,dgj->dgi", spread, out)
            torque = -2 * (c * k)[..., None] * np.cross(turned, normal)
            rest = [rest[0] * (1 + 2 * c * depth), dot(along, torque), dot(across, torque)]
            size = size + 2 * c * np.where(hard, of.volume, 0.0)
            uu = uu + 2 * c * seen(spread, along, along)
            uv = uv + 2 * c * seen(spread, along, across)
            vv = vv + 2 * c * seen(spread, across, across)
        rows = [[size, first_v, -first_u], [first_v, vv, -uv], [-first_u, -uv, uu]]
        return k[..., None, None] * np.stack([np.stack(row, axis=-1) for row in rows], axis=-2), np.stack(rest, axis=-1)

    def _drift(self, given: Inputs, of: Geometry, local: Any, find: bool) -> tuple[Any, Any]:
        """The mean slip (d, g, 3) over the step beside that at its end, and by which part tipping is damped (d, g)."""
        f, regimes, h = self.fixed, self.regimes, self.fixed.duration
        velocity, spin = (
            [given.before[:, 6 * k : 6 * k + 3] for k in range(2)],
            [given.before[:, 6 * k + 3 : 6 * k + 6] for k in range(2)],
        )
        bend = [given.mean[:, 6 * k : 6 * k + 3] - velocity[k] for k in range(2)]
        twist = [given.mean[:, 6 * k + 3 : 6 * k + 6] - spin[k] for k in range(2)]
        if find:
            sizes = [float(dot(each[0].real, each[0].real)) for each in spin]
            regimes.carrier = 0 if sizes[0] < sizes[1] else 1
        carrier = regimes.carrier
        other = 1 - carrier
        apart = given.centres[:, 1] - given.centres[:, 0]
        around = turned_by(h * given.mean[:, 6 * carrier + 3 : 6 * carrier + 6], apart) / h
        around = around - np.cross(spin[carrier], apart)
        arm = of.centroid - given.centres[:, other, None]
        beside = (spin[other] - spin[carrier])[:, None]
        by_spin = np.cross(spin[other][:, None], arm)
        speed2 = dot(by_spin, by_spin)
        moved = of.centroid - f.history[:, :3]
        lasting = f.history[:, 3]
        if find:
            still = ~(speed2[0].real > (STILL * f.speed) ** 2)
            new = lasting == 0
            unmoved = dot(moved[0].real, moved[0].real) == 0
            regimes.staying = np.where(still | new, "still", np.where(unmoved, "last", "moved"))
            if min(sizes) > 0:
                near = abs(sizes[0] - sizes[1]) < KINK * max(sizes)
                self._kink("carrier", np.full(len(f.directed), near))
            damps = f.directed & (f.recovery > 0) & ~new
            self._kink("tipping", (still & damps) | (~still & ~new & unmoved & f.directed))
        moves = regimes.staying == "moved"
        with np.errstate(all="ignore"):
            ratio = dot(moved / np.where(lasting > 0, lasting, 1)[:, None] - velocity[other][:, None], by_spin) / speed2
        stays = np.where(moves, ratio, np.where(regimes.staying == "last", f.history[:, 4], 0.0))
        if find:
            # At rest, it is what rounding in the core made of it.
            real = np.where(regimes.staying == "still", f.history[:, 5], stays[0].real)
            kept = np.where(real < -1, 1.0, np.clip(real, 0, 1))
            # At a limit, the contact goes on as it did.
            varies = moves & (real > KINK) & (real < 1 - KINK)
            regimes.clamped = np.where(varies, np.nan, kept), np.where(varies, np.nan, np.clip(real, 0, 1))
            near = (np.abs(real) <= KINK) | (np.abs(real - 1) <= KINK)
            self._kink("tipping", moves & f.directed & (near | (damps & (np.abs(real + 1) <= KINK))))
        kept, part = (np.where(np.isnan(each), stays, each) for each in regimes.clamped)
        turning = np.cross(spin[carrier][:, None], np.cross(beside, arm)) + part[..., None] * np.cross(beside, by_spin)
        linear = (bend[0] - bend[1] + around)[:, None] + (h / 2 if other == 0 else -h / 2) * turning
        angular = np.broadcast_to((twist[0] - twist[1])[:, None], linear.shape)
        return local(linear, angular)[..., 3:], kept

    def _shares(self, area: Any, of: Geometry, normal: Any, stiffness: Any, force: Any) -> Any:
        """(d, g, g) N s/m: the damping of each patch by its recovery, as far as it follows each patch's slip."""
        f = self.fixed
        together = f.directed & (f.recovery > 0)
        same = np.einsum("dgi,dki->dgk", normal, normal)
        same = np.where(same.real > 0, same, 0)
        same = np.where(np.eye(len(together), dtype=bool), 1.0, same)
        same = np.where(together[:, None] & together, same, 0)
        volume = np.where(of.volume.real > 0, of.volume, 1.0)
        wide = np.where(area.real > volume.real ** (2 / 3), area, volume ** (2 / 3))
        slope = stiffness * (wide + 2 * f.hardening * of.volume)
        stiff, total = np.einsum("dgk,dk->dg", same, slope), np.einsum("dgk,dk->dg", same, force)
        total = np.where(together, total, 1)
        found = (f.recovery * stiff * force / total**2)[..., None] * same * force[:, None]
        alone = ~f.directed & (f.recovery > 0)
        if alone.any():
            single = np.where(alone, f.recovery * stiffness * np.where(alone, of.volume, 1.0) ** (2 / 3), 0)
            found = found + single[..., None] * np.eye(len(alone))
        return found

    def _pressed(
        self,
        given: Inputs,
        of: Geometry,
        target: Any,
        response: Any,
        pressure: Any,
        area: Any,
        normal: Any,
        along: Any,
        across: Any,
        find: bool,
    ) -> Any:
        """The pressures (d, g, 3) that the law gives, of those that press."""
        f, regimes, h = self.fixed, self.regimes, self.fixed.duration
        some = np.where(f.directed, area, 1.0)
        to = np.where(f.directed[:, None], of.centre - of.centroid, 0.0)
        u, v = dot(to, along), dot(to, across)
        moments = np.where(f.directed[:, None, None], of.moments, np.eye(3)) / some[..., None, None]
        uu, uv, vv = (
            np.einsum("dgi,dgij,dgj->dg", one, moments, two)
            for one, two in ((along, along), (along, across), (across, across))
        )
        least = 1e-9 * (uu + vv)
        uu, vv = uu + least, vv + least
        square = uu * vv - uv * uv
        mobility = self._mobility(given, of, normal, along, across)
        back = h * response @ mobility
        asked = np.linalg.solve(np.eye(3) + back, (target + np.einsum("dgij,dgj->dgi", back, pressure))[..., None])[
            ..., 0
        ]
        share = np.where(asked[..., 0].real > 0, asked[..., 0], 0)
        x, y = -asked[..., 2] - share * u, asked[..., 1] - share * v
        far = (vv * x * x - 2 * uv * x * y + uu * y * y) / square
        if find:
            scale = np.abs(given.stiffness[0].real * of.volume[0].real)
            scale = np.maximum(scale, np.abs(response[0, :, 0, 0].real) * f.speed)
            regimes.pressing = pressure[0, :, 0].real > NONE * scale
            self._kink("opening", np.abs(target[0, :, 0].real) < KINK * scale)
            within = f.directed & (asked[0, :, 0].real > 0)
            limit = REACH2 * asked[0, :, 0].real ** 2
            regimes.drawn = ~(within & ~(far[0].real > limit))
            near = np.abs(far[0].real - limit) < KINK * limit
            self._kink("edge", regimes.pressing & within & near)
        drawn = regimes.drawn & f.directed
        safe = np.where(drawn, far, 1.0)
        reach = np.sqrt(REACH2 / np.where(safe.real > 0, safe, 1.0))
        on_edge = np.stack([np.ones_like(u), v + reach * y, -(u + reach * x)], axis=-1) * target[..., :1]
        on_edge = np.where(drawn[:, None], on_edge, target * np.array([1.0, 0, 0]))
        return np.where(regimes.drawn[:, None], on_edge, target)

    def _mobility(self, given: Inputs, of: Geometry, normal: Any, along: Any, across: Any) -> Any:
        """(d, g, 3, 3) the change of the normal slips by pressures in 1 s."""
        rows = []
        for k, sign in enumerate((1, -1)):
            arm = of.centroid - given.centres[:, k, None]
            zero = np.zeros_like(normal)
            linear = [normal, zero, zero]
            angular = [np.cross(arm, normal), along, across]
            rows.append(sign * np.concatenate([np.stack(linear, axis=-2), np.stack(angular, axis=-2)], axis=-1))
        whole = np.concatenate(rows, axis=-1)  # (d, g, 3, 12)
        return np.einsum("dgij,djk,dglk->dgil", whole, given.admittance, whole)

    def _coulomb(self, name: str, force: Any, slip: Any, radius: Any, limit: Any, find: bool) -> Any:
        """What Coulomb's law misses: the slip where it sticks, and else the force of size `limit` against the slip.

        The third of the slip is a spin, which counts with a `radius` (d, g). Without a radius, the three are spins.
        """
        f, regimes = self.fixed, self.regimes
        flat = np.zeros(limit.shape, dtype=bool)
        if name == "sliding":
            flat = radius.real == 0
            slip = np.concatenate([slip[..., :2], (radius * slip[..., 2])[..., None]], axis=-1)
            spin = np.where(flat, force[..., 2], force[..., 2] / np.where(flat, 1.0, radius))
            force = np.concatenate([force[..., :2], spin[..., None]], axis=-1)
        if find:
            size, most, speed = norm(force)[0].real, limit[0].real, norm(slip)[0].real
            if name == "turning":
                speed = speed * radius[0].real
            acts = regimes.pressing & ((name == "sliding") | (f.rolling > 0))
            full, slow = size >= most * (1 - 1e-9), speed < KINK * f.speed
            slides = full & ~slow
            setattr(regimes, name, np.where(acts & slides, 2, np.where(acts & (most > 0), 1, 0)))
            self._kink({"sliding": "cone", "turning": "rolling"}[name], acts & ~slides & (size >= most * (1 - KINK)))
        regime = getattr(regimes, name)[:, None]
        length = norm(np.where(regime == 2, slip, 1.0))[..., None]
        third = flat[..., None] & np.array([False, False, True])
        held = np.where(third, force, slip)
        return np.where(regime == 0, force, np.where(regime == 1, held, force * length + limit[..., None] * slip))
