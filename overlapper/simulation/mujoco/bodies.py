"""The bodies of a MuJoCo model."""

from __future__ import annotations

import warnings
from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from overlapper.simulation.bodies import AnyBodies
from overlapper.simulation.cautions import UnknownBodyWarning
from overlapper.simulation.contacts import Contacts
from overlapper.simulation.mujoco.contact import GeomContact
from overlapper.simulation.mujoco.distances import own_distances
from overlapper.simulation.mujoco.source import MujocoSource
from overlapper.simulation.naming import named
from overlapper.simulation.settings import Concave, Modelling, Surface


class Bodies(AnyBodies[GeomContact]):
    """The geoms of one MuJoCo simulation as convex shapes placed in the world.

        bodies = Bodies(model, data)
        while ...:
            mujoco.mj_step(model, data)
            bodies.update()
            for contact in bodies.overlaps():
                ...

    Parameters
    ----------
    model : mujoco.MjModel
        The model.
    data : mujoco.MjData
        The data of this model. It must have poses: after mj_forward, mj_step or mj_kinematics.
    names : dict of int to str, optional
        Names of bodies by MuJoCo's numbers. They replace those of the model.
    surface : {'nominal'}
        Accepted as in pybullet's Bodies, so that the same loop works with both.
    concave : {'decompose', 'enclose', 'skip'}
        Accepted as in pybullet's Bodies. It has no effect, as MuJoCo collides convex hulls.
    concave_threshold : float
        Accepted as in pybullet's Bodies. It has no effect.

    Raises
    ------
    TypeError
        If `model` or `data` is of another class.
    ValueError
        If `data` is of another model or has no poses yet, or if a name or the surface is invalid.

    Notes
    -----
    Planes, spheres, capsules, ellipsoids, cylinders, boxes, meshes and height fields are modelled. A plane is infinite,
    as in MuJoCo's collisions. A mesh is the convex hull that MuJoCo collides. A height field has a prism below each of
    its triangles. Only prisms near geoms that may collide with it are modelled. SDF plugins and flexes are in
    `skipped`, with one SkippedShapeWarning each. Surfaces are nominal. MuJoCo's `contact.dist` is a distance of nominal
    surfaces, too.

    Keys are (body, geom, 0) in MuJoCo's numbers, and (body, geom, triangle) for prisms of a height field. Names are
    MuJoCo's: "torso" is a body, "torso/foot1" is a geom.

    `update()` reads the poses of `data`. After mj_step these are the poses before its integration, as in
    `data.contact`. mj_kinematics brings them up to date. Edited sizes, types, meshes and heights are noticed.

    Pairs are those that mj_collision looks at, by masks, welds, parents, excludes, explicit pairs, flags and a
    contact filter in Python, at the last update. `pairs` and `overlaps` take other choices.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        *,
        names: Mapping[int, str] | None = None,
        surface: Surface = "nominal",
        concave: Concave = "decompose",
        concave_threshold: float = 0.05,
    ) -> None:
        for argument, value, kind in (("model", model, mujoco.MjModel), ("data", data, mujoco.MjData)):
            if not isinstance(value, kind):
                raise TypeError(f"{argument} must be a mujoco.{kind.__name__}, not {value!r}")
        if data.model is not model:
            raise ValueError("data is of another model: make it with mujoco.MjData(model)")
        if surface != "nominal":
            raise ValueError(f"surface must be 'nominal', not {surface!r}: MuJoCo has no other surface")
        Modelling(concave, concave_threshold, surface)  # raises for invalid values
        self.model, self.data = model, data
        given = named(names)
        super().__init__(MujocoSource(model, data, given))
        if strange := sorted(given.keys() - self._source.bodies.keys()):
            told = ", ".join(f"{body}: {given[body]!r}" for body in strange)
            warnings.warn(f"names has bodies that are not in the simulation: {told}", UnknownBodyWarning, stacklevel=2)

    def own_distances(self, contacts: Contacts) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        """MuJoCo's own answers for contacts of this simulation, in the poses and the `data.contact` of now.

        Parameters
        ----------
        contacts : Contacts
            The n contacts, from `overlaps()`.

        Returns
        -------
        overlapping : ndarray of bool, shape (n,)
            Whether a contact of the pair in `data.contact` has a negative `dist`. If MuJoCo does not test the pair, the
            sign of the distance decides.
        distances : ndarray, shape (n,)
            The distances of `mj_geomDistance`, m. They are negative for pairs that overlap. They are NaN for parts of
            height fields.

        Examples
        --------
        >>> import mujoco
        >>> from overlapper.mujoco import Bodies
        >>> model = mujoco.MjModel.from_xml_string('''<mujoco><worldbody>
        ...   <geom type="plane" size="1 1 .1"/>
        ...   <body pos="0 0 .04"><freejoint/><geom type="sphere" size=".05"/></body>
        ... </worldbody></mujoco>''')
        >>> data = mujoco.MjData(model)
        >>> mujoco.mj_forward(model, data)
        >>> bodies = Bodies(model, data)
        >>> overlapping, distances = bodies.own_distances(bodies.overlaps())
        >>> overlapping.tolist(), distances.round(9).tolist()
        ([True], [-0.01])
        """
        return own_distances(self.model, self.data, contacts.keys[:, [1, 4]])
