"""Volumetric contact: forces from the volumes that bodies share, in place of the simulator's contact points."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from overlapper.simulation.asked_pairs import Among, listed
from overlapper.simulation.bodies import AnyBodies
from overlapper.simulation.contacts import Contacts
from overlapper.simulation.forces.coming import coming, followed
from overlapper.simulation.forces.forces import Forces, mean
from overlapper.simulation.forces.masses import Masses
from overlapper.simulation.forces.other_forces import OtherForces
from overlapper.simulation.forces.parameter import Layers, OfPair
from overlapper.simulation.forces.told import Told
from overlapper.simulation.model import Array

# A swing that turns by more than so many radians in a step is followed by backward Euler.
COARSE = 2.0

# The most substeps of a step: contacts that are stiffer are damped.
MOST_SUBSTEPS = 200


class VolumetricContact:
    """Contact of pybullet bodies by what they share, instead of Bullet's contact points.

        bodies = Bodies(physicsClientId)
        contact = VolumetricContact(bodies)
        with contact:
            while ...:
                contact.step()  # instead of pybullet.stepSimulation()

    Bodies are elastic foundations (Winkler): they press with `stiffness` (Pa/m) times the depth. A pair is pushed apart
    by stiffness times the volume that it shares, through that volume's centroid, along the area vector of its patch. A
    layer of thickness t and modulus E has the stiffness E / t; two bodies in series have 1 / (1 / k1 + 1 / k2). A body
    rests as deep as its weight is stiffness times volume. What presses a body of several convex parts is the sum of
    what presses these: as if they were one, but twice where the parts overlap each other.

    `dissipation` (s) is how far pressures are ahead of the depth, in time (Kelvin and Voigt). The damping ratio of a
    swing of angular frequency w is w * dissipation / 2, and 0 keeps the energy. `friction` is Coulomb's coefficient, by
    default that of pybullet: the product of the two links' lateralFriction. A patch resists slip and spin together, as
    an ellipsoid of force and torque; what sticks does not creep. "distributed" resists at points spread over the patch
    instead, by pybullet's coefficients, which is more exact where bodies slip and spin at once. Restitution, rolling
    and spinning friction of pybullet are not used. Each may be a function of the pair of links, as stiffness=lambda a,
    b: ..., of (body, link) twice, which is asked once for each pair.

    A step of the simulator is taken in `substeps`, by default as many as the stiffness and the masses ask for, and
    anew in every step. Too few of them are told with one SubstepsWarning for each pair; their contacts are then solved
    by backward Euler, which loses energy.

    `pairs` are those that `Bodies.pairs` takes, by default all that the simulator lets collide. Within the `with`,
    Bullet does not respond to these, whether they touch or not, and getContactPoints has none of them; it simulates all
    else: joints, motors, constraints and other pairs. A `Bodies` with a recorder knows which pairs a script has
    filtered; without one they are pushed apart, too.

    What else acts on the bodies, as gravity, motors, constraints and forces of the script, is taken to be as it was in
    the substep before. Commands of a script to motors and constraints within the `with`, and the forces that it
    applies, are given again in each substep. So they last for the whole step, though pybullet keeps them as impulses.
    Gains of motors are those of a whole step, too. Motors that were told before, unless a recorder has heard it, are as
    much stronger as substeps are shorter.

    A body without a finite pose or velocity has no contacts, with one SkippedShapeWarning; the others go on.

    A body that lies wholly within another, or goes through a plate, has no direction. It is pushed where it was pushed
    last, or along the least translation that frees it, with one NoDirectionWarning for each pair.

    After `step()` or `forces()` there is a row for each pair of shapes that overlaps, of the last substep, in SI units
    and the world. The rows of `force`, `torque`, `centre`, `energy` and `slip` are parallel to `contacts`. `last` has
    them all, and `mean()` the mean over the whole step.

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
        if not isinstance(bodies, AnyBodies):
            raise TypeError(f"bodies must be the Bodies of a simulation, not {bodies!r}")
        self.bodies = bodies
        among: Among = "simulated" if pairs is None else pairs
        self._among: Among = among if isinstance(among, str) else listed(among)
        bodies.update()
        bodies.link_pairs(self._among)  # says what is wrong with them
        self._layers = Layers(stiffness, dissipation, friction)
        whole = isinstance(substeps, (int, np.integer)) and not isinstance(substeps, bool)
        if substeps != "auto" and not (whole and int(substeps) >= 1):
            raise ValueError(f"substeps must be a whole number from 1, or 'auto', not {substeps!r}")
        self._substeps = substeps
        self._mechanics = bodies.mechanics()
        self._inside = False
        self._parts: list[tuple[float, Forces]] = []  # of a step, the parts that substeps are, and their forces
        self._told = Told(bodies)
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
                velocity, lost = self._velocity()
                frequency2 = self._place(lost)
                if not self._planned:
                    # Once in a step is enough for what comes; a length that changes within a swing costs energy.
                    highest = max(frequency2.max(initial=0.0), 0.0 if taken else self._coming(duration, velocity))
                    if not taken or highest * length**2 > 1:
                        length = left / min(followed(highest, left), max(1, MOST_SUBSTEPS - taken))
                wrenches = self._solve(length, velocity, frequency2)
                self._mechanics.begin(length, duration, first=not taken)
                self._masses.dynamics.apply(wrenches, self._frames)
                self._mechanics.step()
                self._parts.append((length / duration, self._found))
                left -= length
                taken += 1
        finally:
            self._mechanics.stepped(duration)
        self.substeps = taken
        self._others.left_at(self._masses.velocity()[0])
        self._mechanics.announce()

    def forces(self) -> Forces:
        """The forces with which a step of the simulator would begin, without taking it: for scripts that integrate."""
        self._refresh()
        velocity, lost = self._velocity()
        frequency2 = self._place(lost)
        duration = self.bodies.time_step
        substeps = self._planned or min(followed(frequency2.max(initial=0.0), duration), MOST_SUBSTEPS)
        self._solve(duration / substeps, velocity, frequency2)
        return self._found

    def mean(self) -> Forces:
        """The overlaps now, with the mean of force and torque over the last step, which moved the bodies in it.

        Forces of single substeps go up and down about it, as motors do. `slip` is of the end of the step. What has
        pressed and parted within the step is not among the rows; what has come at its very end has no force yet.
        """
        self._follow()
        contacts = self.bodies.overlaps(pairs=self._among)
        return mean(contacts, self._parts, self._masses.stiffness(contacts.overlaps))

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
        """Force (3,) in N and torque (3,) in N m about the world's origin, by all pairs, on a body or a link of it.

        ValueError if there is no such body or link.
        """
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
        if self._masses.are_stale():
            self._model()
        elif self._masses.dynamics.read():
            self._others = OtherForces(self._masses.dynamics.gravity)
        if self._inside and self._rules is not self.bodies.rules:
            # A script may have let pairs collide since, or made new ones.
            self._rules = self.bodies.rules
            self._mechanics.turn_off(self.bodies.link_pairs(self._among))

    def _follow(self) -> None:
        """Where the bodies are within a step, or at its end."""
        self.bodies.follow()
        if self._masses.keys is not self.bodies.keys:
            self._model()
            self._parts = []

    def _model(self) -> None:
        """Read the masses and joints of the bodies that there are."""
        self._masses = Masses(self.bodies, self._mechanics, self._layers)
        self._others = OtherForces(self._masses.dynamics.gravity)

    @property
    def _planned(self) -> int:
        """The substeps that were asked for; 0 if that is left to the stiffness."""
        return 0 if self._substeps == "auto" else int(self._substeps)

    def _velocity(self) -> tuple[Array, set[int]]:
        """The velocities of all coordinates; the bodies that have none that is finite, which are told."""
        velocity, lost = self._masses.velocity()
        self._told.of_velocity(lost)
        return velocity, lost

    def _place(self, lost: set[int]) -> Array:
        """Give the solver what all but the `lost` bodies share where they are; the squares of frequencies by row."""
        self._contacts = self.bodies.overlaps(pairs=self._among)
        if lost:
            of_lost = np.isin(self._contacts.keys[:, [0, 3]], [*lost]).any(axis=1)
            self._contacts = self._contacts[np.flatnonzero(~of_lost)]
        self._frames = self._masses.dynamics.frames()
        solver = self._masses.dynamics.solver
        frequency2, self._stiffness = self._masses.place(solver, self._frames, self._contacts.overlaps)
        return frequency2

    def _coming(self, duration: float, velocity: Array) -> float:
        """The square of the highest frequency of what bodies will share in a time as long as that."""
        ahead = self._others.ahead(velocity, duration)
        return coming(self._masses, self._frames, self._contacts.overlaps, duration, ahead, self._among)

    def _solve(self, duration: float, velocity: Array, frequency2: Array) -> Array:
        """The forces of a step as long as that; (n, 6) force and torque on the links."""
        other = self._others.learnt(velocity)
        damped = frequency2 * duration**2 > COARSE**2
        if damped.any():
            planned = self._planned or MOST_SUBSTEPS
            self._told.of_substeps(self._contacts, damped, frequency2, duration, planned)
        wrenches: Array
        force, torque, slip, normal, directed, wrenches, ours, self.sweeps = self._masses.dynamics.solver.solve(
            duration, velocity, other, damped, self._layers.distributed
        )
        self._found = Forces(self._contacts, force, torque, slip, normal, directed, self._stiffness)
        if not directed.all():
            self._told.of_direction(self._contacts, ~directed)
        self._others.solved(velocity, duration, ours)
        return wrenches
