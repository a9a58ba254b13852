"""Loads models into pybullet and compares what `Bodies` makes of them with what pybullet says of itself.

`python model_walk.py RESULTS MODEL...` appends a line to RESULTS when it begins a model and another when it is done. A
model may kill the process: then only its first line is there.
"""

import json
import sys
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
import pybullet as p
from scipy.spatial import cKDTree

from overlapper import Box, Capsule, Cylinder, HalfSpace, Hull, Placed, Sphere, distance, penetration_depth
from overlapper.simulation import Bodies

KINDS = {
    p.GEOM_BOX: Box,
    p.GEOM_SPHERE: Sphere,
    p.GEOM_CAPSULE: Capsule,
    p.GEOM_CYLINDER: Cylinder,
    p.GEOM_PLANE: HalfSpace,
    p.GEOM_MESH: Hull,
}
MARGIN = 1e-3  # of Bullet around hulls
# Inside of boxes and cylinders, whose edges it rounds; loadMJCF leaves it at Bullet's own default.
ROUNDING = {".urdf": 1e-3, ".sdf": 1e-3, ".xml": 0.04}
PROBE = 1e-4  # m, radius of the ball with which points are asked about
STATES = 2  # of the joints
EARLY = 5e-5  # m, by which Bullet's GJK has been seen to stop early on hulls of some hundred corners


def load(path, client, flags=0):
    if path.suffix == ".urdf":
        # Visual shapes are not tested here, and loading them takes nine tenths of the time.
        return p.loadURDF(str(path), flags=flags | p.URDF_IGNORE_VISUAL_SHAPES, physicsClientId=client)
    if path.suffix == ".sdf":
        return p.loadSDF(str(path), physicsClientId=client)
    return p.loadMJCF(str(path), flags=flags, physicsClientId=client)


class Walk:
    """One model in one client, and in a second one where pybullet may be asked anything.

    getCollisionShapeData kills the process on the capsules that loadMJCF makes by default, and Bullet collides with
    thin ones wrongly; with URDF_USE_IMPLICIT_CYLINDER they are plain capsules.
    """

    def __init__(self, path, clients):
        self.client, self.twin = clients if path.suffix == ".xml" else clients[:1] * 2
        for client in {self.client, self.twin}:
            p.resetSimulation(physicsClientId=client)
            p.setAdditionalSearchPath(str(path.parent), physicsClientId=client)
            load(path, client, p.URDF_USE_IMPLICIT_CYLINDER if client != self.client else 0)
        self.bodies = Bodies(self.client)
        self.ball = p.createCollisionShape(p.GEOM_SPHERE, radius=PROBE, physicsClientId=self.twin)
        self.random = np.random.default_rng(1)
        self.rounded_corner = ROUNDING[path.suffix] * (np.sqrt(3) - 1)
        self.problems = []
        self.skipped = {(each.body, each.link): each.reason for each in self.bodies.skipped}
        ids = [p.getBodyUniqueId(i, self.client) for i in range(p.getNumBodies(self.client))]
        self.links = [(id, link) for id in ids for link in range(-1, p.getNumJoints(id, self.client))]

    def complain(self, link, sentence):
        self.problems.append(f"body {link[0]}, link {link[1]}: {sentence}")

    def parts(self, link):
        return [placed for key, placed in zip(self.bodies.keys, self.bodies.placed) if key[:2] == link]

    def check_shapes(self):
        """Every shape that pybullet lists is there, and every corner of its hulls."""
        for link in self.links:
            entries = p.getCollisionShapeData(*link, self.twin)
            listed = Counter(KINDS[entry[2]] for entry in entries)
            parts = self.parts(link)
            modelled = Counter(type(part.shape) for part in parts)
            meshes, hulls = listed.pop(Hull, 0), modelled.pop(Hull, 0)
            if listed != modelled:
                self.complain(link, f"pybullet lists {dict(listed)}, modelled are {dict(modelled)}")
            corners = p.getMeshData(*link, physicsClientId=self.twin)[1] if meshes else ()
            if (meshes > 0) != (hulls > 0) and link not in self.skipped:
                self.complain(link, f"{meshes} meshes are {hulls} hulls")
            # pybullet returns no corners for a concave mesh.
            if corners and self.pose(link):
                self.check_corners(link, np.array(corners), [part for part in parts if isinstance(part.shape, Hull)])

    def check_corners(self, link, corners, hulls):
        origin, orientation = self.pose(link)
        corners = corners @ np.array(p.getMatrixFromQuaternion(orientation)).reshape(3, 3).T + origin
        rounding = 1e-12 * (1 + np.abs(corners).max())
        inside = np.zeros(len(corners), dtype=bool)
        for hull in hulls:
            rotation = np.array(p.getMatrixFromQuaternion(hull.orientation)).reshape(3, 3)
            ours, planes = hull.shape.vertices @ rotation.T + hull.position, hull.shape.halfspaces
            if cKDTree(corners).query(ours)[0].max() > rounding:
                self.complain(link, "a hull has a corner that pybullet does not know")
            inside |= cKDTree(ours).query(corners)[0] <= rounding  # most are corners of ours
            beyond = (corners[~inside] - hull.position) @ rotation @ planes[:, :3].T + planes[:, 3]
            inside[~inside] = beyond.max(axis=1) <= rounding
        if not inside.all() and link not in self.skipped:
            self.complain(link, f"{(~inside).sum()} corners of pybullet are in no hull")

    def pose(self, link):
        """The pose of the link's inertial frame. None for bodies of more than 128 links: pybullet returns no poses."""
        if p.getNumJoints(link[0], self.client) > 128:
            return None
        if link[1] < 0:
            return p.getBasePositionAndOrientation(link[0], self.client)
        return p.getLinkState(*link, computeForwardKinematics=1, physicsClientId=self.client)[:2]

    def check_places(self):
        """Distances, rays and boxes are Bullet's in several states of the joints."""
        for _ in range(STATES):
            self.move_joints()
            self.bodies.update()
            for link in self.links:
                if parts := self.parts(link):
                    point = self.point_near(parts)
                    self.check_distance(link, parts, point)
                    self.check_ray(link, parts, point)
                    self.check_box(link, parts)

    def move_joints(self):
        for id, link in self.links:
            if link >= 0 and p.getJointInfo(id, link, self.client)[2] in (p.JOINT_REVOLUTE, p.JOINT_PRISMATIC):
                angle = self.random.uniform(-0.5, 0.5)
                for client in {self.client, self.twin}:
                    p.resetJointState(id, link, angle, physicsClientId=client)

    def point_near(self, parts):
        """A point above the solid of a plane, or around the boxes of the parts."""
        direction = self.random.normal(size=3)
        if isinstance(parts[0].shape, HalfSpace):
            return parts[0].position + np.array([*direction[:2], 1 + abs(direction[2])])
        lower, upper = self.box(parts)
        return (lower + upper) / 2 + direction / np.linalg.norm(direction) * np.linalg.norm(upper - lower)

    def box(self, parts):
        bounds = np.array([part.bounds for part in parts])
        return bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)

    def check_distance(self, link, parts, point):
        ball = Placed(Sphere(PROBE), point)
        nearest = p.getClosestPoints(
            link[0],
            -1,
            1e3,
            linkIndexA=link[1],
            collisionShapeB=self.ball,
            collisionShapePositionB=point,
            physicsClientId=self.twin,
        )
        bullet = min(each[8] for each in nearest)
        low = min(distance(part, ball) - self.nearer(part.shape) for part in parts)
        high = min(distance(part, ball) + self.farther(part.shape) for part in parts)
        if bullet > high + 3e-6 or (bullet < low - 3e-6 and link not in self.skipped):
            self.complain(link, f"Bullet is at a distance of {bullet}, modelled from {low} to {high}")

    def nearer(self, shape):
        """How much nearer than the nominal shape Bullet's may be."""
        if isinstance(shape, Box) and shape.half_extents.min() < MARGIN:
            return MARGIN  # the margin does not fit in
        return MARGIN * isinstance(shape, Hull)

    def farther(self, shape):
        """How much farther than the nominal shape Bullet's may be."""
        if isinstance(shape, Hull):
            return EARLY - MARGIN
        return self.rounded_corner * isinstance(shape, Box | Cylinder)

    def check_ray(self, link, parts, point):
        lower, upper = self.box(parts)
        target = (lower + upper) / 2 if np.isfinite(lower).all() else parts[0].position
        ((id, hit, _, where, _),) = p.rayTest(point, target, physicsClientId=self.twin)
        if (id, hit) != link or link in self.skipped:
            return
        # The ball at the point that the ray hit is half in, give or take the margin and the precision of the ray.
        ball = Placed(Sphere(PROBE), where)
        off = min(distance(part, ball) for part in parts)
        depth = max(penetration_depth(ball, part) for part in parts)
        if off > 2 * MARGIN or depth > 2 * MARGIN:
            self.complain(link, f"a ray hits {off} outside or {depth} inside")

    def check_box(self, link, parts):
        lower, upper = self.box(parts)
        theirs = np.array(p.getAABB(*link, self.client))
        # pybullet does not return the boxes of bodies of more than 128 links either.
        if not (np.isfinite(lower).all() and np.isfinite(upper).all()) or not self.pose(link):
            return
        if (lower < theirs[0] - 1e-6).any() or (upper > theirs[1] + 1e-6).any():
            self.complain(link, f"the box {lower}, {upper} is not within Bullet's {theirs.tolist()}")


def examine(path, clients):
    """A dict of the counts of a model and its problems. If pybullet cannot load the model, only its error."""
    try:
        walk = Walk(path, clients)
    except p.error as error:
        return {"loaded": False, "problems": [str(error)]}
    walk.check_shapes()
    walk.check_places()
    names = Counter(type(shape).__name__ for shape in walk.bodies.shapes)
    skipped = [[each.name, each.reason] for each in walk.bodies.skipped]
    return {"loaded": True, "shapes": names, "skipped": skipped, "problems": walk.problems}


if __name__ == "__main__":
    warnings.simplefilter("ignore", UserWarning)  # of shapes left out: they are among the results
    clients = p.connect(p.DIRECT), p.connect(p.DIRECT)  # for all models: to connect takes as long as to load one
    with open(sys.argv[1], "a", buffering=1) as results:
        for model in sys.argv[2:]:
            results.write(json.dumps([model, None]) + "\n")
            results.write(json.dumps([model, examine(Path(model), clients)]) + "\n")
