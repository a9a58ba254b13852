"""Volumetric contact: forces from the volumes that bodies share, in place of the simulator's contact points."""

from __future__ import annotations

import math
import warnings
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from overlapper import Batch, Overlaps
from overlapper._core import ContactSolver
from overlapper.simulation.asked_pairs import Among, listed
from overlapper.simulation.bodies import AnyBodies
from overlapper.simulation.cautions import NoDirectionWarning, SubstepsWarning
from overlapper.simulation.contacts import Contacts
from overlapper.simulation.forces.forces import Forces
from overlapper.simulation.forces.parameter import OfPair, Parameter
from overlapper.simulation.model import Array, LinkKey

# A swing that turns by more than so many radians in a step is followed by backward Euler.
COARSE = 2.0

# There is no patch where the area vector is less than this part of the surface of what is shared, as to the solver.
NO_PATCH = 1e-6

# A body that moves by less than that (m, rad) in a step rests.
STILL = 1e-9

# How often a step is halved to find when what is swallowed by its end has a patch.
BISECTIONS = 8

# The most substeps of a step: contacts that are stiffer are damped.
MOST_SUBSTEPS = 200


class VolumetricContact:
    """Contact of pybullet bodies by what they share, instead of Bullet's contact points.

        bodies = Bodies(physicsClientId)
        contact = VolumetricContact(bodies)
        with contact:
            while ...:
                contact.step()  # instead of pybullet.stepSimulation()

    Bodies are elastic foundations (Winkler): they press with `stiffness` (Pa/m) times the depth, so that a pair is
    pushed apart by stiffness times the volume that it shares, through that volume's centroid, along the area vector of
    its patch. A layer of thickness t and modulus E has the stiffness E / t; two bodies in series have
    1 / (1 / k1 + 1 / k2). A body rests as deep as its weight is stiffness times volume. What presses a body of several
    convex parts is the sum of what presses these: as if they were one, but twice where the parts overlap each other.

    `dissipation` (s) is how far pressures are ahead of the depth, in time (Kelvin and Voigt): the damping ratio of a
    swing of angular frequency w is w * dissipation / 2, and 0 keeps the energy. `friction` is Coulomb's coefficient, by
    default that of pybullet: the product of the two links' lateralFriction. A patch resists slip and spin together, as
    an ellipsoid of force and torque; what sticks does not creep. "distributed" resists at points spread over the patch
    instead, by pybullet's coefficients, which is more exact where bodies slip and spin at once. Restitution, rolling
    and spinning friction of pybullet are not used. Each may be a function of the pair of links, as
    stiffness=lambda a, b: ..., of (body, link) twice, which is asked once for each pair.

    A step of the simulator is taken in `substeps`, by default as many as the stiffness and the masses ask for, and
    anew in every step. Too few of them are told with one SubstepsWarning for each pair; their contacts are then solved
    by backward Euler, which loses energy.

    `pairs` are those that `Bodies.pairs` takes, by default all that the simulator lets collide. Within the `with`,
    Bullet does not respond to these, whether they touch or not, and getContactPoints has none of them; it simulates all
    else: joints, motors, constraints and other pairs. A `Bodies` with a recorder knows which pairs a script has
    filtered; without one they are pushed apart, too.

    What else acts on the bodies, as gravity, motors, constraints and forces of the script, is taken to be as it was in
    the substep before. What a script tells motors and constraints within the `with`, and the forces that it applies, is
    told again in each substep, so that it lasts for the whole step: pybullet keeps it as an impulse. Gains of motors
    are those of a whole step, too. Motors that were told before, unless a recorder has heard it, are as much stronger
    as substeps are shorter.

    What has no direction, as a body that lies wholly within another or goes through a plate, is pushed where it was
    pushed last, or along the least translation that frees it, with one NoDirectionWarning for each pair.

    After `step()` or `forces()` there is a row for each pair of shapes that overlaps, of the last substep, in SI units
    and the world: `contacts`, and parallel to it `force`, `torque`, `centre`, `energy` and `slip`; `last` has them all,
    and `mean()` the mean over the whole step.

    ValueError says what is wrong with an argument, RuntimeError at the `with` that its client is within one already.
    """

    def __init__(
        self,
        bodies: AnyBodies,
        pairs: Among | None = None,
        stiffness: float | OfPair = 1e7,
        dissipation: float | OfPair = 1e-3,
        friction: float | OfPair | Literal["distributed"] | None = None,
        substeps: int | Literal["auto"] = "auto",
    ) -> None:
        self.bodies = bodies
        among: Among = "simulated" if pairs is None else pairs
        self._among: Among = among if isinstance(among, str) else listed(among)
        bodies.update()
        bodies.link_pairs(self._among)  # says what is wrong with them
        distributed = isinstance(friction, str) and friction == "distributed"
        self._distributed = distributed
        self._stiffness = Parameter("stiffness", stiffness, "Pa/m", positive=True)
        self._dissipation = Parameter("dissipation", dissipation, "s")
        self._friction = None
        if friction is not None and not distributed:
            self._friction = Parameter("friction", friction, "")  # type: ignore[arg-type]  # no other text is a number
        whole = isinstance(substeps, (int, np.integer)) and not isinstance(substeps, bool)
        if substeps != "auto" and not (whole and int(substeps) >= 1):
            raise ValueError(f"substeps must be a whole number from 1, or 'auto', not {substeps!r}")
        self._substeps = substeps
        self._mechanics = bodies.mechanics()
        self._inside = False
        self._parts: list[tuple[float, Forces]] = []  # of a step, the parts that substeps are, and their forces
        self._after: Array | None = None  # the velocity that the last step left
        self._warned: set[tuple[str, LinkKey, LinkKey]] = set()
        self._model()
        none = np.empty((0, 3))
        self._found = Forces(bodies.overlaps(pairs=[]), none, none, none, none, np.empty(0, dtype=bool), np.empty(0))
        self.substeps = 0
        """The number of substeps of the last step."""
        self.sweeps = 0
        """How often the solver went through all pairs in the last substep."""

    def __enter__(self) -> VolumetricContact:
        self._rules = self.bodies.rules
        self._mechanics.enter(self.bodies.link_pairs(self._among))
        self._inside = True
        return self

    def __exit__(self, *_: object) -> None:
        self._inside = False
        self._mechanics.leave()

    def step(self) -> None:
        """Let the simulation go on by one of its time steps.

        RuntimeError outside of the `with`, where Bullet would push the bodies apart as well.
        """
        if not self._inside:
            raise RuntimeError("step() is for within `with contact:`, where Bullet does not respond to these pairs")
        duration = self.bodies.time_step
        self._refresh()
        left, taken = duration, 0
        length = duration / (self._planned or 1)
        self._parts = []
        try:
            while left > 1e-9 * duration:
                if taken:
                    self._follow()
                frequency2 = self._place(self._dynamics.solver)
                velocity = self._dynamics.velocity()
                if not self._planned:
                    # Once in a step is enough for what comes; a length that changes within a swing costs energy.
                    highest = max(frequency2.max(initial=0.0), 0.0 if taken else self._coming(duration, velocity))
                    if not taken or highest * length**2 > 1:
                        length = left / min(_followed(highest, left), max(1, MOST_SUBSTEPS - taken))
                wrenches = self._solve(length, velocity, frequency2)
                self._mechanics.begin(length, duration, first=not taken)
                self._dynamics.apply(wrenches, self._frames)
                self._mechanics.step()
                self._parts.append((length / duration, self._found))
                left -= length
                taken += 1
        finally:
            self._mechanics.stepped(duration)
        self.substeps = taken
        self._after = self._dynamics.velocity()
        self._mechanics.announce()

    def forces(self) -> Forces:
        """The forces with which a step of the simulator would begin, without taking it: for scripts that integrate."""
        self._refresh()
        frequency2 = self._place(self._dynamics.solver)
        duration = self.bodies.time_step
        substeps = self._planned or min(_followed(frequency2.max(initial=0.0), duration), MOST_SUBSTEPS)
        self._solve(duration / substeps, self._dynamics.velocity(), frequency2)
        self._after = None
        return self._found

    def mean(self) -> Forces:
        """The overlaps now, with the mean of force and torque over the last step, which moved the bodies in it.

        Forces of single substeps go up and down about it, as motors do. `slip` is of the end of the step. What has
        pressed and parted within the step is not among the rows; what has come at its very end has no force yet.
        """
        self._follow()
        contacts = self.bodies.overlaps(pairs=self._among)
        found = contacts.overlaps
        codes = self._codes(found)
        area = found.gradient[:, 1, :3]
        size = np.linalg.norm(area, axis=1)
        directed = (size > NO_PATCH * found.area) | (found.volume == 0)
        normal: Array = np.array(found.normal)
        patches = directed & (size > 0)
        normal[patches] = area[patches] / size[patches, None]
        force, torque, slip = (np.zeros((len(found), 3)) for _ in range(3))
        for part, forces in self._parts:
            before = self._codes(forces.contacts.overlaps)
            _, now, then = np.intersect1d(codes, before, assume_unique=True, return_indices=True)
            force[now] += part * forces.force[then]
            torque[now] += part * forces.torque[then]
            if forces is self._parts[-1][1]:
                slip[now] = forces.slip[then]
                lost = ~directed[now]
                normal[now[lost]] = forces.normal[then[lost]]
        return Forces(contacts, force, torque, slip, normal, directed, self._parameters(found)[0])

    @property
    def last(self) -> Forces:
        """All of the last substep or `forces()`, which no later step changes."""
        return self._found

    @property
    def contacts(self) -> Contacts:
        """The overlaps, a row for each pair of shapes."""
        return self._found.contacts

    @property
    def pairs(self) -> NDArray[np.int64]:
        """(p, 6) integers bodyA, linkA, shapeA, bodyB, linkB, shapeB of each row."""
        return self._found.pairs

    @property
    def force(self) -> Array:
        """(p, 3) N, on the first of each pair; on the second the opposite."""
        return self._found.force

    @property
    def torque(self) -> Array:
        """(p, 3) N m, on the first about `centre`: of pressures that change, and of friction that resists a spin."""
        return self._found.torque

    @property
    def centre(self) -> Array:
        """(p, 3) m, the centroid of what is shared: what the force goes through."""
        return self._found.centre

    @property
    def energy(self) -> Array:
        """(p,) J, stored in the pressures; see `Forces.energy`."""
        return self._found.energy

    @property
    def slip(self) -> Array:
        """(p, 3) m/s, of the first over the second at `centre`, along the patch, at the end of the substep."""
        return self._found.slip

    def on(self, body: int, link: int | None = None) -> tuple[Array, Array]:
        """Force (3,) in N and torque (3,) in N m about the world's origin, by all pairs, on a body or a link of it."""
        return self._found.on(body, link)

    def __len__(self) -> int:
        return len(self._found)

    def __bool__(self) -> bool:
        return True  # also where nothing presses, as it steps all the same

    def __repr__(self) -> str:
        return f"VolumetricContact({len(self)} pairs of shapes press, {self.substeps} substeps)"

    def _refresh(self) -> None:
        """See what has come or gone, and how heavy things are."""
        self.bodies.update()
        if self._keys is not self.bodies.keys or self._restored != self._mechanics.restored:
            self._model()
        elif self._dynamics.read():
            self._forget()
        if self._inside and self._rules is not self.bodies.rules:
            # A script may have let pairs collide since, or made new ones.
            self._rules = self.bodies.rules
            self._mechanics.turn_off(self.bodies.link_pairs(self._among))

    def _follow(self) -> None:
        """Where the bodies are within a step, or at its end."""
        self.bodies.follow()
        if self._keys is not self.bodies.keys:
            self._model()
            self._parts = []

    def _codes(self, found: Overlaps) -> NDArray[np.int64]:
        """The pairs of rows, as one number each."""
        first, second = found.pairs.T.astype(np.int64)
        return np.asarray(first * len(self._keys) + second)

    def _model(self) -> None:
        """Read the masses and joints of the bodies that there are."""
        self._keys, self._restored = self.bodies.keys, self._mechanics.restored
        self._dynamics = self._mechanics.dynamics(sorted({body for body, _, _ in self._keys}))
        self._links = np.array([self._dynamics.place[body, link] for body, link, _ in self._keys], dtype=np.int64)
        self._frames = self._dynamics.frames()
        self._batch = Batch(self.bodies.shapes)  # for what is not yet: the one of `bodies` knows what is
        self._forget()

    def _forget(self) -> None:
        """Forget the accelerations of before: they are of other bodies."""
        self._after = None
        self._before: tuple[Array, float, Array] | None = None  # velocity, duration and our part of the acceleration
        self._other = self._dynamics.gravity

    @property
    def _planned(self) -> int:
        """The substeps that were asked for; 0 if that is left to the stiffness."""
        return 0 if self._substeps == "auto" else int(self._substeps)

    def _place(self, solver: ContactSolver) -> Array:
        """Give a solver what bodies share where they are; the squares of frequencies by row."""
        self._contacts = self.bodies.overlaps(pairs=self._among)
        self._frames = self._dynamics.frames()
        found = self._contacts.overlaps
        self._moduli, dissipation, friction = self._parameters(found)
        frequency2: Array = solver.place(self._frames, found, self._links, self._moduli, dissipation, friction)
        return frequency2

    def _parameters(self, found: Overlaps) -> tuple[Array, Array, Array]:
        """Stiffness, dissipation and coefficient of friction, by row."""
        dynamics = self._dynamics
        links = self._links[found.pairs]
        if self._friction is None:
            friction = dynamics.friction[links].prod(axis=1)
        else:
            friction = self._friction.of(links, dynamics.links)
        return self._stiffness.of(links, dynamics.links), self._dissipation.of(links, dynamics.links), friction

    def _coming(self, duration: float, velocity: Array) -> float:
        """The square of the highest frequency of what bodies will share in a time as long as that.

        A body that came in by a long step would be deeper than its speed can take it: it would be thrown back. So steps
        are short before they have to be: before two touch, and before an edge comes down to a face.
        """
        solver = self._dynamics.solver.copy()
        if self._before:
            before, length, _ = self._before
            velocity = velocity + duration / length * (velocity - before)
        else:
            velocity = velocity + duration * self._other
        # Bodies at rest bring no new contact.
        if np.abs(velocity).max(initial=0.0) * duration < STILL:
            return 0.0
        highest = 0.0
        known: set[tuple[int, int]] | None = None
        # A small and fast body is swallowed within the step: then it counts when it was half in, and for how long.
        lost: set[tuple[int, int]] = set()
        early, late, part = 0.0, 1.0, 1.0
        for _ in range(BISECTIONS):
            found = self._at(part * duration, velocity)
            frequency2 = solver.place(self._frames, found, self._links, *self._parameters(found))
            highest = max(highest, float(frequency2.max(initial=0.0)))
            swallowed = _swallowed(found)
            if swallowed:
                known = _swallowed(self._contacts.overlaps) if known is None else known
                swallowed -= known
            if swallowed:
                late, lost = part, swallowed
            elif lost and lost.isdisjoint(map(tuple, found.pairs[found.volume > 0].tolist())):
                early = part
            else:
                break
            part = (early + late) / 2
        return max(highest, (2 / (late - early) / duration) ** 2) if lost else highest

    def _at(self, duration: float, velocity: Array) -> Overlaps:
        """The overlaps after a duration in which all coordinates go on with that velocity."""
        bodies = self.bodies
        positions, orientations = self._dynamics.solver.ahead(
            duration, velocity, self._links, bodies.positions, bodies.orientations
        )
        pairs = bodies.pairs_at(positions, orientations, self._among)
        return self._batch.overlaps(positions, orientations, pairs, separated=False)

    def _solve(self, duration: float, velocity: Array, frequency2: Array) -> Array:
        """The forces of a step as long as that; (n, 6) force and torque on the links."""
        dynamics = self._dynamics
        self._other = self._others(velocity)
        self._after = None
        damped = frequency2 * duration**2 > COARSE**2
        if damped.any():
            self._tell_of_substeps(damped, frequency2, duration)
        wrenches: Array
        force, torque, slip, normal, directed, wrenches, ours, self.sweeps = dynamics.solver.solve(
            duration, velocity, self._other, damped, self._distributed
        )
        self._found = Forces(self._contacts, force, torque, slip, normal, directed, self._moduli)
        if not directed.all():
            self._tell_of_direction(~directed)
        self._before = velocity, duration, ours
        return wrenches

    def _others(self, velocity: Array) -> Array:
        """The acceleration of all coordinates by what else acts."""
        # It is told by how velocities have changed, unless somebody has set them since.
        if self._before and (self._after is None or np.array_equal(self._after, velocity)):
            before, length, ours = self._before
            # After forces() nothing may have moved; a body that rests to the last bit tells nothing new.
            if not np.array_equal(before, velocity):
                return (velocity - before) / length - ours
        return self._other

    def _pairs_of(self, rows: NDArray[np.bool_]) -> list[tuple[LinkKey, LinkKey]]:
        return [((a, la), (b, lb)) for a, la, _, b, lb, _ in self._contacts.keys[rows].tolist()]

    def _tell_of_substeps(self, damped: NDArray[np.bool_], frequency2: Array, duration: float) -> None:
        for (a, b), square in zip(self._pairs_of(damped), frequency2[damped].tolist()):
            if ("substeps", a, b) not in self._warned:
                self._warned.add(("substeps", a, b))
                needed = math.ceil(math.sqrt(square) * duration * max(1, self._substeps_given))
                names = self.bodies.names
                warnings.warn(
                    f"{self._substeps_given} substeps are too few for the stiffness between {names[a]} and {names[b]}, "
                    f"which swing at up to {math.sqrt(square):.0f} rad/s: {needed} would follow them; until then their "
                    "contact loses energy",
                    SubstepsWarning,
                    stacklevel=4,
                )

    @property
    def _substeps_given(self) -> int:
        return MOST_SUBSTEPS if self._substeps == "auto" else int(self._substeps)

    def _tell_of_direction(self, lost: NDArray[np.bool_]) -> None:
        for a, b in self._pairs_of(lost):
            if ("direction", a, b) not in self._warned:
                self._warned.add(("direction", a, b))
                names = self.bodies.names
                warnings.warn(
                    f"{names[a]} and {names[b]} share a volume without a side to push to, as one lies within the other "
                    "or goes through it; they are pushed as they were last",
                    NoDirectionWarning,
                    stacklevel=4,
                )


def _followed(frequency2: float, duration: float) -> int:
    """How many substeps of a duration follow a swing of that frequency, squared."""
    return max(1, math.ceil(math.sqrt(frequency2) * duration))


def _swallowed(found: Overlaps) -> set[tuple[int, int]]:
    """The pairs in which one lies wholly in the other: their overlap has no patch."""
    area = found.gradient[:, 1, :3]
    rows = (found.volume > 0) & ((area * area).sum(axis=1) <= (NO_PATCH * found.area) ** 2)
    return {(a, b) for a, b in found.pairs[rows].tolist()} if rows.any() else set()
