"""Volumetric contact: forces from the volumes that bodies share, in place of the simulator's contact points."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from overlapper.simulation.asked_pairs import Among, listed
from overlapper.simulation.bodies import AnyBodies
from overlapper.simulation.contacts import Contacts
from overlapper.simulation.forces.coming import Coming, coming, followed
from overlapper.simulation.forces.derivatives import StepDerivatives
from overlapper.simulation.forces.equations import Solved, StepEquations
from overlapper.simulation.forces.forces import Forces, mean
from overlapper.simulation.forces.masses import Masses
from overlapper.simulation.forces.pads import Pad
from overlapper.simulation.forces.parameter import Layers, OfPair
from overlapper.simulation.forces.tactile import TactileImage
from overlapper.simulation.forces.told import Told
from overlapper.simulation.model import Array, LinkKey

# A swing that turns by more than so many radians in a step is followed by backward Euler.
COARSE = 2.0

# The most substeps of a step: contacts that are stiffer are damped.
MOST_SUBSTEPS = 200

# The most substeps if no dissipation is given, as nothing swings then.
FEW_SUBSTEPS = 2

# A mean depth of more than this share of the smaller body is worth a warning.
DEEP = 0.2


class VolumetricContact:
    """Contact forces from the volumes that bodies share, in place of the contact points of pybullet or MuJoCo.

        bodies = Bodies(physicsClientId)  # or overlapper.mujoco.Bodies(model, data)
        contact = VolumetricContact(bodies)
        with contact:
            while ...:
                contact.step()  # or pybullet.stepSimulation(), or mujoco.mj_step(model, data)

    Parameters
    ----------
    bodies : Bodies
        The bodies of a simulation.
    pairs : {'simulated', 'all'} or list of pairs, optional
        Pairs as in `Bodies.pairs`. Default: all pairs that the simulator lets collide.
    stiffness : float or callable, optional
        Pressure for each metre of depth, Pa/m. A layer of thickness t and modulus E has the stiffness E / t. Two bodies
        in series have 1 / (1 / k1 + 1 / k2). Default: from masses, sizes and gravity, so that a ball rests less than a
        thousandth of its diameter deep, even under ten times its weight. With a `dissipation`, the default is 1e7.
    dissipation : float or callable, optional
        Time in s by which pressures are ahead of the depth (Kelvin and Voigt). The damping ratio of an oscillation of
        angular frequency w is w * dissipation / 2. A dissipation of 0 keeps the energy. Default: 0.001, and depths
        recover within 0.02 s along the normal of each patch. Bodies then bounce by their `restitution` alone. This
        damping does not resist what rolls.
    friction : float, callable or 'distributed', optional
        Coulomb's coefficient. Default: that of the simulator. In pybullet it is the product of the two links'
        lateralFriction, in MuJoCo the sliding friction of the two geoms. With "distributed", friction acts at points
        spread over the patch, with the simulator's coefficients. This is more exact where bodies slip and spin at once.
    substeps : int or 'auto', default 'auto'
        Number of parts of a step of the simulator. 'auto': with a `dissipation`, it follows from the stiffness and the
        masses, anew in every step. Without one, it follows from the motion. It is 1 for bodies that move little, 2 for
        others, and more for small bodies that would be within others at the end of the step. A body that passes through
        another one within a substep is not noticed. `Bodies.first_overlaps` finds it.
    restitution : float or callable, optional
        The speed after an impact over the speed before it. Slower impacts than 0.2 m/s have none. Default: that of the
        simulator. In pybullet it is the product of the two links' restitution, which is 0 unless it is set. In MuJoCo
        it is 0. It must not be given with `dissipation`.
    rolling : float or callable, optional
        The largest torque against rolling over the force, m. Default: that of the simulator. In pybullet it is the
        rollingFriction of each link times the lateralFriction of the other link, added. In MuJoCo it is the rolling
        friction of contacts of dimension 6.
    hardening : float or callable, optional
        Growth of the stiffness with the depth, 1/m: the pressure at the depth d is stiffness * d * (1 + hardening * d).
        Default: 0, which is the linear law. It is for contacts with half-spaces alone, such as planes and the ground.
        In pybullet, GEOM_PLANE and plane_implicit.urdf are half-spaces. The ground of plane.urdf is a box.
        It must be 0 for other pairs, whose patches are not flat, and must not be given with "distributed" friction.

    Raises
    ------
    TypeError
        If `bodies` is not the Bodies of a simulation.
    ValueError
        If another argument is invalid. The message names it. In MuJoCo also if the model has a geom that is not
        modelled, another integrator than Euler, or sleeping bodies.
    RuntimeError
        At the `with`, if the simulation has an active VolumetricContact already.

    Notes
    -----
    Bodies are elastic foundations (Winkler): the pressure is `stiffness` times the depth. The force between a pair is
    stiffness times the common volume. It goes through the centroid of this volume, along the area vector of the contact
    patch. A body rests at the depth where stiffness times volume is its weight. The force on a body of several convex
    parts is the sum of the forces on its parts, as if the parts were one body. Where the parts overlap each other, the
    force counts twice.

    `stiffness`, `dissipation`, `friction`, `restitution`, `rolling` and `hardening` may be functions of the pair of
    links, as in stiffness=lambda a, b: .... The arguments are two (body, link), in MuJoCo two (body, geom). Numbers of
    pairs are kept as long as the bodies and their masses are the same.

    A patch resists slip and spin together: its force and torque stay within an ellipsoid. Sticking bodies do not creep.
    The simulator's spinning friction adds to the torque of the patch.

    With a `hardening` c and a stiffness k, the force of a volume V below a plane is k V (1 + 2 c z), where z is the
    depth of the centroid. This force has a torque about the centroid, by the second moments of the volume. A box of
    area A and weight W rests at the depth d where k A d (1 + c d) = W.

    The solver solves the laws of all pairs together, to a `residual` of 1e-8 of the largest slip. If bodies that touch
    each other have more than 300 coordinates, their pairs are solved one after the other, 10,000 times in all. A
    residual above 1e-8 gives one UnsettledWarning.

    If there are too few substeps for a `dissipation`, each pair gives one SubstepsWarning. The contacts of such pairs
    are then solved by backward Euler, which loses energy. A pair that stays deeper than a fifth of its smaller body for
    0.1 s gives one DepthWarning.

    Within the `with`, the simulator does not respond to these pairs, whether they touch or not. It has no contact
    points of them. It simulates everything else: joints, motors, constraints and, in pybullet, other pairs.

    Other code that steps the simulation within the `with`, such as a gymnasium environment, works without a change. In
    pybullet, a call of stepSimulation makes a `step()`, unless its name was imported from pybullet earlier. In MuJoCo,
    each mj_step is one substep.

    In pybullet, a `Bodies` with a recorder knows which pairs a script has filtered. Without a recorder, filtered pairs
    are pushed apart, too. The solver knows constraints between links other than gears, and the motors of single joints
    that the script commands within the `with`, or that a recorder has heard. All other forces on the bodies (gravity,
    other motors, forces of the script) are assumed to be as in the substep before. If there are constraints,
    solverResidualThreshold is 0 within the `with`, and pybullet's default afterwards. A threshold that a script has set
    and a listener has heard is kept. Within the `with`, the script's commands to motors and constraints and the forces
    that it applies are given again in each substep. So they last for the whole step, though pybullet keeps them as
    impulses. Gains of motors are those of a whole step, too. A motor that was commanded before the `with` is stronger
    by the number of substeps, unless a recorder knows the command. After `restoreState`, bodies move as they did after
    `saveState`, to the last bit, if both are called within the `with`. For a state in a file, or for other masses than
    at that time, the solver begins anew.

    In MuJoCo, all other forces are known, because MuJoCo computes them first. Its contacts can only be turned off for
    all pairs at once, so `pairs` must contain all pairs that it lets collide. The flag belongs to the model: other data
    of the same model have no contacts within the `with`, either. `data.xfrc_applied` keeps the forces of the script.
    After `step()`, `data` has the poses from before the last integration, as after mj_step.

    A `with` block without a noticed step or `forces()` gives a NoStepWarning if bodies have moved meanwhile.

    A body without a finite pose or velocity has no contacts, with one SkippedShapeWarning. The other bodies continue.

    If a body lies wholly within another, or goes through a plate, its force has no direction. The body is pushed in its
    last direction, or along the shortest translation that separates it. Each such pair gives one NoDirectionWarning.

    After `step()` or `forces()` there is a row for each pair of shapes that overlaps in the last substep. Values are in
    SI units and in world coordinates. The rows of `force`, `torque`, `centre`, `energy` and `slip` are parallel to
    `contacts`. `last` has them all. `mean()` has the mean over the whole step.
    """

    def __init__(
        self,
        bodies: AnyBodies,
        pairs: Among | None = None,
        stiffness: float | OfPair | None = None,
        dissipation: float | OfPair | None = None,
        friction: float | OfPair | Literal["distributed"] | None = None,
        substeps: int | Literal["auto"] = "auto",
        restitution: float | OfPair | None = None,
        rolling: float | OfPair | None = None,
        hardening: float | OfPair | None = None,
    ) -> None:
        if not isinstance(bodies, AnyBodies):
            raise TypeError(f"bodies must be the Bodies of a simulation, not {bodies!r}")
        self.bodies = bodies
        among: Among = "simulated" if pairs is None else pairs
        self._among: Among = among if isinstance(among, str) else listed(among)
        bodies.update()
        bodies.link_pairs(self._among)  # says what is wrong with them
        self._layers = Layers(stiffness, dissipation, friction, restitution, rolling, hardening)
        whole = isinstance(substeps, (int, np.integer)) and not isinstance(substeps, bool)
        if substeps != "auto" and not (whole and int(substeps) >= 1):
            raise ValueError(f"substeps must be a whole number from 1, or 'auto', not {substeps!r}")
        self._substeps = substeps
        self._mechanics = bodies.mechanics()
        self._inside = False
        # Where the bodies were at the `with`, until a step or forces are asked for.
        self._unasked: tuple[Array, Array] | None = None
        self._parts: list[tuple[float, Forces]] = []  # of a step, the parts that substeps are, and their forces
        self._told = Told(bodies)
        self._duration = 0.0  # s, of the step
        self._solved: tuple[Masses, float, Array, Array, NDArray[np.bool_] | None, Array] | None = None
        self._driven = False  # by motors or constraints
        self._model()
        none = np.empty((0, 3))
        undirected, zero = np.empty(0, dtype=bool), np.empty(0)
        self._found = Forces(bodies.overlaps(pairs=[]), none, none, none, none, undirected, zero, zero, bodies.frames)
        self.substeps = 0
        """The number of substeps of the last step."""
        self.sweeps = 0
        """How often the solver went through all pairs in the last substep."""

    def __enter__(self) -> VolumetricContact:
        self.bodies.update()
        self._unasked = self.bodies.positions.copy(), self.bodies.orientations.copy()
        self._rules = self.bodies.rules
        self._mechanics.enter(self.bodies.link_pairs(self._among), self._answer, self._step_instead)
        self._inside = True
        return self

    def __exit__(self, kind: type[BaseException] | None = None, *_: object) -> None:
        self._inside = False
        self._mechanics.leave()
        if kind is None and self._unasked:
            self._told.of_no_step(*self._unasked)

    def step(self) -> None:
        """Advance the simulation by one of its time steps.

        Raises
        ------
        RuntimeError
            Outside of the `with`, because the simulator would push the bodies apart as well.
        """
        if not self._inside:
            raise RuntimeError(
                "step() must be called within `with contact:`, where the simulator does not push these pairs apart"
            )
        self._duration = duration = self.bodies.time_step
        self._mechanics.announce_begin()
        self._mechanics.prepare()
        self._refresh()
        left, taken = duration, 0
        length = duration / (self._planned or 1)
        self._parts = []
        try:
            while left > 1e-9 * duration:
                if taken:
                    self._mechanics.prepare()
                    self._follow()
                velocity, lost = self._velocity()
                frequency2 = self._place(lost)
                if not self._planned:
                    # Once in a step is enough for what comes; a length that changes within a swing costs energy.
                    ahead = Coming() if taken else self._coming(duration, velocity)
                    planned = round(left / length) if taken else 0
                    parts = self._needed(frequency2, velocity, ahead, left, taken, planned)
                    if parts > planned:
                        length = left / parts
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
        self._tell_of_depth(duration)
        self._others.left_at(self._masses.velocity()[0])
        self._mechanics.announce()

    def forces(self) -> Forces:
        """The forces at the beginning of a step, without taking the step.

        It is meant for scripts that integrate by themselves. Such scripts should give a dissipation and a stiffness.
        The default contact is too stiff for an explicit step of the whole length.

        Returns
        -------
        Forces
            A row for each pair of shapes that overlaps.
        """
        self._mechanics.prepare()
        self._refresh()
        velocity, lost = self._velocity()
        frequency2 = self._place(lost)
        self._duration = duration = self.bodies.time_step
        substeps = self._planned or self._needed(frequency2, velocity, Coming(), duration)
        self._solve(duration / substeps, velocity, frequency2)
        self._tell_of_depth(duration)
        return self._found

    def derivatives(self) -> StepDerivatives:
        """The derivatives of the last substep, or of `forces()`, by velocities, poses, forces, stiffness and friction.

        They are those of a whole step if it has one substep, as with substeps=1. They exist in pybullet, for free
        bodies and for bodies with joints.

        Returns
        -------
        StepDerivatives
            Matrices, and the contacts whose laws are not smooth here.

        Raises
        ------
        ValueError
            Before the first step. In MuJoCo, or if there are constraints, motors that a script commands, height fields
            or `friction="distributed"`.
        RuntimeError
            If the solver ended before the forces were settled.
        """
        if self._solved is None:
            raise ValueError("derivatives are those of a step: call step() or forces() first")
        masses, duration, velocity, acceleration, damped, history = self._solved
        tree, refused = masses.dynamics.tree(), ""
        if tree is None:
            refused = "MuJoCo's bodies, whose masses MuJoCo alone knows"
        elif masses.has_tops:
            refused = "height fields"
        elif self._layers.distributed:
            refused = 'friction="distributed"'
        elif self._driven:
            refused = "constraints, and motors that a script commands"
        if tree is None or refused:
            raise ValueError(f"derivatives are not known for {refused}")
        solved = Solved(
            self._found,
            duration,
            velocity,
            acceleration,
            damped,
            self._frames,
            masses.dynamics.links,
            tree,
            masses.of_shapes,
            masses.laws(self._found.contacts.overlaps),
            history,
        )
        return StepEquations(solved).derivatives()

    def mean(self) -> Forces:
        """The overlaps now, with the mean of force and torque over the last step.

        The mean is what moved the bodies in the step. Forces of single substeps oscillate about the mean, as motors do.
        A pair that separated within the step has no row. A pair that began to overlap at the very end of the step has
        no force yet.

        Returns
        -------
        Forces
            `slip` is that at the end of the step.
        """
        self._mechanics.pose()
        self._follow()
        contacts, masses = self.bodies.overlaps(pairs=self._among), self._masses
        found = contacts.overlaps
        laws = masses.stiffness(found), masses.hardening(found)
        return mean(contacts, self._parts, *laws, masses.areas(found), self.bodies.frames)

    @property
    def last(self) -> Forces:
        """All results of the last substep or of `forces()`. Later steps do not change them."""
        return self._found

    @property
    def contacts(self) -> Contacts:
        """The overlaps, with a row for each pair of shapes."""
        return self._found.contacts

    @property
    def pairs(self) -> NDArray[np.int64]:
        """(p, 6) integers bodyA, linkA, shapeA, bodyB, linkB, shapeB of each row."""
        return self._found.pairs

    @property
    def force(self) -> Array:
        """(p, 3) the force in N on the first of each pair. The second gets the opposite force."""
        return self._found.force

    @property
    def torque(self) -> Array:
        """(p, 3) the torque in N m on the first of each pair, about `centre`.

        It comes from pressures that change and from friction that resists spinning.
        """
        return self._found.torque

    @property
    def centre(self) -> Array:
        """(p, 3) the centroid of the common volume in m. The force goes through this point."""
        return self._found.centre

    @property
    def energy(self) -> Array:
        """(p,) the energy in J that the pressures store. See `Forces.energy`."""
        return self._found.energy

    @property
    def slip(self) -> Array:
        """(p, 3) the velocity in m/s of the first over the second at `centre`, along the patch.

        It is that at the end of the substep.
        """
        return self._found.slip

    @property
    def residual(self) -> float:
        """The residual of the solver in the last substep. See `Forces.residual`."""
        return self._found.residual

    def on(self, body: int, link: int | None = None) -> tuple[Array, Array]:
        """Force and torque on a body or on a link of it, from all pairs.

        Forces between links of one body cancel, unless one link is given.

        Parameters
        ----------
        body : int
            The number of the body.
        link : int, optional
            The number of the link, -1 for the base. Default: the whole body.

        Returns
        -------
        force : (3,) ndarray
            The force in N, in world coordinates.
        torque : (3,) ndarray
            The torque about the world's origin in N m.

        Raises
        ------
        ValueError
            If there is no such body or link.
        """
        return self._found.on(body, link)

    def pressure(self, link: LinkKey, grid: Pad, tolerance: float = 1e-2) -> TactileImage:
        """The pressure and the shear on the taxels of a pad, in the last substep. See `Forces.pressure`.

        Parameters
        ----------
        link : (int, int)
            Body and link of the pad, -1 for the base. In MuJoCo: body and geom.
        grid : TaxelGrid or Taxels
            The taxels.
        tolerance : float, default 0.01
            Allowed relative error of the common volume of round bodies.

        Returns
        -------
        TactileImage
            An entry for each taxel.

        Raises
        ------
        TypeError
            If `grid` is something else.
        ValueError
            If there is no such link, it has no modelled shape, or `tolerance` is invalid.
        """
        return self._found.pressure(link, grid, tolerance)

    def __len__(self) -> int:
        return len(self._found)

    def __bool__(self) -> bool:
        return True  # also where nothing presses, as it steps all the same

    def __repr__(self) -> str:
        return f"VolumetricContact({len(self)} pairs of shapes press, {self.substeps} substeps)"

    def _step_instead(self) -> None:
        """Make the step that the script asks the simulator for."""
        self._told.further = 2  # this call and the one that stands in for the simulator's
        try:
            self.step()
        finally:
            self._told.further = 0

    def _answer(self) -> None:
        """Apply the forces of a step that the simulator makes by itself, in one piece."""
        self._told.further = 2  # the simulator's callback is between
        try:
            self._refresh()
            velocity, lost = self._velocity()
            frequency2 = self._place(lost)
            self._duration = self.bodies.time_step
            wrenches = self._solve(self._duration, velocity, frequency2, whole=True)
            self._tell_of_depth(self._duration)
        finally:
            self._told.further = 0
        self._masses.dynamics.apply(wrenches, self._frames)
        self._parts, self.substeps = [(1.0, self._found)], 1

    def _refresh(self) -> None:
        """Read which bodies have come or gone, and the masses."""
        self._unasked = None
        self.bodies.update()
        if not self._masses.are_stale() and self._masses.dynamics.read():
            self._others = self._masses.dynamics.other_forces()
        others = self._mechanics.resumed(self._others)
        if others is None or self._masses.are_stale():
            self._model()
        else:
            self._others = others
        if self._inside and self._rules is not self.bodies.rules:
            # A script may have let pairs collide since, or made new ones.
            self._rules = self.bodies.rules
            self._mechanics.turn_off(self.bodies.link_pairs(self._among))

    def _follow(self) -> None:
        """Read where the bodies are within a step, or at its end."""
        self.bodies.follow()
        if self._masses.keys is not self.bodies.keys:
            self._model()
            self._parts = []

    def _model(self) -> None:
        """Read the masses and joints of the bodies."""
        self._masses = Masses(self.bodies, self._mechanics, self._layers)
        self._layers.check(self.bodies.link_pairs(self._among), self._masses.flat_links())
        self._others = self._masses.dynamics.other_forces()

    @property
    def _planned(self) -> int:
        """The number of substeps that the caller asked for; 0 if it is chosen from the stiffness."""
        return 0 if self._substeps == "auto" else int(self._substeps)

    def _velocity(self) -> tuple[Array, set[int]]:
        """Return the velocities of all coordinates and the bodies without a finite one, and warn of these."""
        velocity, lost = self._masses.velocity()
        self._told.of_velocity(lost)
        return velocity, lost

    def _place(self, lost: set[int]) -> Array:
        """Give the solver the overlaps of all but the `lost` bodies, at their poses now.

        Returns the squares of the frequencies by row.
        """
        self._contacts, self._frame = self.bodies.overlaps(pairs=self._among), self.bodies.frames
        if lost:
            of_lost = np.isin(self._contacts.keys[:, [0, 3]], [*lost]).any(axis=1)
            self._contacts = self._contacts[np.flatnonzero(~of_lost)]
        self._frames = self._masses.dynamics.frames()
        solver = self._masses.dynamics.solver
        frequency2, self._stiffness = self._masses.place(solver, self._frames, self._contacts.overlaps)
        return frequency2

    def _needed(
        self, frequency2: Array, velocity: Array, coming: Coming, left: float, taken: int = 0, planned: int = 0
    ) -> int:
        """Return the number of substeps for the time (s) that is `left`, after those that are `taken`.

        It need not be known below the number that was `planned` before.

        `frequency2` (p,) are squares of frequencies of the contacts now. Without a `dissipation` contacts do not swing:
        the number then follows from how far surfaces move over each other.
        """
        most = max(1, MOST_SUBSTEPS - taken)
        if not self._layers.recovers:
            return min(followed(max(frequency2.max(initial=0.0), coming.highest, coming.swallowed), left), most)
        few = max(1, FEW_SUBSTEPS - taken)
        if planned >= few:
            return planned
        if coming.deep or not self._masses.are_steady(left, velocity):
            return max(few, min(followed(coming.swallowed, left), most))
        return 1

    def _coming(self, duration: float, velocity: Array) -> Coming:
        """Return the overlaps that come within the duration. See `coming`."""
        ahead = self._others.ahead(velocity, duration)
        found, all_frequencies = self._contacts.overlaps, not self._layers.recovers
        return coming(self._masses, self._frames, found, duration, ahead, self._among, all_frequencies)

    def _tell_of_depth(self, duration: float) -> None:
        """Warn of bodies that are deep in each other at the end of a step of this duration (s)."""
        depths, sizes = self._masses.dynamics.solver.depths, self._masses.sizes_of(self._contacts.overlaps)
        self._told.of_depth(self._contacts, depths > DEEP * sizes, depths, sizes, duration)

    def _solve(self, duration: float, velocity: Array, frequency2: Array, whole: bool = False) -> Array:
        """Return (n, 6) force and torque on the links, in a substep of this duration or in a `whole` step."""
        other = self._others.learnt(velocity)
        damped = None if self._layers.recovers else frequency2 * duration**2 > COARSE**2
        if damped is not None and damped.any():
            planned = 1 if whole else self._planned or MOST_SUBSTEPS
            self._told.of_substeps(self._contacts, damped, frequency2, duration, planned)
        wrenches: Array
        dynamics = self._masses.dynamics
        motors = dynamics.motors(duration, duration / self._duration)
        constraints = dynamics.constraints(duration)
        self._driven = motors is not None or constraints is not None
        force, torque, slip, normal, directed, wrenches, _, ours, self.sweeps, residual = dynamics.solver.solve(
            duration,
            velocity,
            other,
            damped,
            self._layers.distributed,
            dynamics.ahead(duration, velocity) if len(self._contacts) else None,
            motors,
            constraints,
        )
        self._found = Forces(
            *(self._contacts, force, torque, slip, normal, directed, self._stiffness),
            *(self._masses.hardening(self._contacts.overlaps), self._frame, residual),
        )
        self._told.of_residual(residual, self.sweeps)
        if not directed.all():
            self._told.of_direction(self._contacts, ~directed)
        self._others.solved(velocity, duration, ours)
        self._solved = self._masses, duration, velocity, np.array(other), damped, dynamics.solver.before
        return wrenches
