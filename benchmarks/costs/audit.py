"""`overlapper audit` beside pinocchio and coal, and on every robot of example-robot-data.

    python benchmarks audit speed [ROUNDS]           configurations a second of a Franka, on one core
    python benchmarks audit robots [CONFIGURATIONS]  the table of docs/audit.md
    python benchmarks audit proofs [BOXES]           the table of proofs of docs/audit.md
    python benchmarks audit moveit URDF SRDF ...     what MoveIt's files disable beside what is proved

The first needs `pip install pin`, which is pinocchio with coal. Both sides have the same convex shapes: those that
pybullet has made. Ours looks at blocks as in an audit, with volumes and depths; theirs says yes or no for the same
pairs of shapes, one configuration after the other, with and without a tree of boxes. Figures are medians of rounds in
which all take turns.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from functools import reduce
from importlib.metadata import distribution
from operator import add
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import numpy as np

from harness.bodies import of_coal
from harness.page import table
from harness.timing import timed
from overlapper import Placed
from overlapper.audit.audit import audit
from overlapper.audit.examiner import Examiner
from overlapper.audit.robot import read_robot
from overlapper.audit.sampling import Sampling
from overlapper.audit.srdf import read_srdf
from overlapper.simulation.bullet.model_file import NotRead

ROBOTS = Path(distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots"))
FRANKA = "panda_description/urdf/panda.urdf"


class Peer:
    """Pinocchio and coal on the shapes of an examiner, for the pairs that are asked for in every configuration."""

    def __init__(self, path: Path, examiner: Examiner) -> None:
        import pinocchio

        self.pin, self.examiner = pinocchio, examiner
        self.model = pinocchio.buildModelFromUrdf(str(path))
        self.data = self.model.createData()
        self.geometry = pinocchio.GeometryModel()
        tree = examiner.robot.tree
        pinocchio.framesForwardKinematics(self.model, self.data, pinocchio.neutral(self.model))
        neutral = np.array([degree_at_0 for degree in examiner.robot.degrees for degree_at_0 in at_0(degree)])
        (positions,), (orientations,) = examiner.kinematics.poses(neutral[None])
        for number, (shape, position, turn) in enumerate(zip(tree.shapes, positions, orientations)):
            frame = self.model.getFrameId(tree.links[shape.link].name, pinocchio.FrameType.BODY)
            parent = self.model.frames[frame].parentJoint
            where = pinocchio.XYZQUATToSE3(np.concatenate([position, turn]))
            placement = self.data.oMi[parent].actInv(where)
            self.geometry.addGeometryObject(
                pinocchio.GeometryObject(str(number), parent, frame, placement, of_coal(Placed(shape.shape))[0])
            )
        asked = [pair for pair in examiner.pairs if not (pair.rigid or pair.adjacent)]
        self.pairs = examiner.shape_pairs(*asked)
        for a, b in self.pairs.tolist():
            self.geometry.addCollisionPair(pinocchio.CollisionPair(a, b))
        self.geometry_data = self.geometry.createData()
        self.tree = pinocchio.BroadPhaseManager_DynamicAABBTreeCollisionManager(
            self.model, self.geometry, self.geometry_data
        )

    def positions(self, configuration: np.ndarray) -> np.ndarray:
        """Pinocchio's configuration vector."""
        robot, q = self.examiner.robot, self.pin.neutral(self.model)
        values = {degree.name: configuration[degree.column] for degree in robot.degrees}
        for name, mimic in robot.mimics.items():
            values[name] = values[mimic.leader] * mimic.multiplier + mimic.offset
        for name, value in values.items():
            joint = self.model.joints[self.model.getJointId(name)]
            q[joint.idx_q : joint.idx_q + joint.nq] = value if joint.nq == 1 else [np.cos(value), np.sin(value)]
        return q

    def one_by_one(self, q: np.ndarray) -> None:
        self.pin.computeCollisions(self.model, self.data, self.geometry, self.geometry_data, q, False)

    def by_tree(self, q: np.ndarray) -> None:
        self.pin.computeCollisions(self.model, self.data, self.tree, q, False)


def at_0(degree) -> tuple[float, ...]:
    return (0.0, 0.0, 0.0, 1.0) if degree.range == "spherical" else (0.0,)


def speed(rounds: int = 5) -> None:
    """Processor time per configuration, of blocks that nobody has looked at before."""
    count = 2000
    robot = read_robot(ROBOTS / FRANKA)
    sampling = Sampling(robot, 4096 * (rounds + 3), seed=0)
    examiner = Examiner(robot, sampling)
    peer = Peer(ROBOTS / FRANKA, examiner)
    print(f"{FRANKA}: {len(robot.tree.shapes)} shapes, {len(peer.pairs)} pairs of them asked for")
    taken = {"overlapper: volume and depth": [], "kinematics of these": [], "coal: yes or no": [], "by its tree": []}
    for block in range(2, rounds + 2):
        configurations = sampling.block(block)
        qs = [peer.positions(each) for each in configurations[:count]]
        ways = {
            "overlapper: volume and depth": (lambda: examiner(block), len(configurations)),  # noqa: B023
            "kinematics of these": (lambda: examiner.kinematics.poses(configurations), len(configurations)),  # noqa: B023
            "coal: yes or no": (lambda: [peer.one_by_one(q) for q in qs], len(qs)),  # noqa: B023
            "by its tree": (lambda: [peer.by_tree(q) for q in qs], len(qs)),  # noqa: B023
        }
        for way, (work, done) in ways.items():
            taken[way].append(timed(work) / done)
    for way, seconds in taken.items():
        middle = median(seconds)
        print(f"{way:30}{1e6 * middle:8.1f} µs{1 / middle:12,.0f} configurations a second")


def robots(count: int = 2000) -> None:
    """A row for each robot, by `audit` in this process; seconds are of a processor."""
    heading = ["robot", "joints", "links", "pairs", "adjacent", "never", "sometimes", "always", "s"]
    paths = sorted(ROBOTS.rglob("*.urdf"), key=lambda path: path.stem.lower())
    print(table(heading, (row_of(path, count) for path in paths)))


def row_of(path: Path, count: int) -> list[str]:
    try:
        robot = read_robot(path)
    except NotRead as error:
        return [path.stem, str(error).rpartition(": ")[2], *[""] * 7]
    found = []
    seconds = timed(lambda: found.append(audit(robot, count)))
    counts = [len(found[0].of_status(status)) for status in ("never", "sometimes", "always")]
    links = len({shape.link for shape in robot.tree.shapes})
    pairs = len(found[0].pairs)
    cells = [path.stem, len(robot.degrees), links, pairs, pairs - sum(counts), *counts, f"{seconds:.1f}"]
    return list(map(str, cells))


PROVED = [
    "panda",
    "ur5_robot",
    "ur10_robot",
    "kinova",
    "xarm7",
    "z1",
    "so101",
    "solo",
    "talos_left_arm",
    "go2",
]


SURVIVED = 1_000_000  # random configurations in which no proved pair may overlap


def proofs(limit: int = 20_000) -> None:
    """A row for each of ten robots: what sampling says beside what is proved, and two tests of the proofs.

    "Refused" counts proofs that `verify` refuses. "Overlap in 10⁶" counts proved pairs that overlap in configurations
    which the search has not seen.
    """
    heading = ["robot", "joints", "pairs", "sampled never", "proved never", "overlap", "open", "largest open share"]
    heading += ["proof s", "check s", "refused", "overlap in 10⁶"]
    print(table(heading, []))
    for name in PROVED:
        print(table(heading, [proofs_of(name, limit)]).splitlines()[-1], flush=True)


def proofs_of(name: str, limit: int) -> list[str]:
    from overlapper.audit.cover_file import verify, write_covers
    from overlapper.audit.prove import prove

    robot = read_robot(next(ROBOTS.rglob(f"{name}.urdf")))
    sampled = audit(robot, 10_000)
    found, checked = [], []
    seconds = timed(lambda: found.extend(prove(sampled, limit)))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "covers.npz"
        write_covers(robot, found, path)
        check = timed(lambda: checked.extend(verify(robot, path)))
    counts = [sum(each.verdict == verdict for each in found) for verdict in ("never", "overlaps", "open")]
    share = max((each.open_share for each in found if each.verdict == "open"), default=0.0)
    cells = [name, len(robot.degrees), len(found), len(sampled.of_status("never")), *counts, f"{100 * share:.3g} %"]
    never = [each.pair for each in found if each.verdict == "never"]
    cells += [f"{seconds:.1f}", f"{check:.1f}", sum(bool(each.wrong) for each in checked)]
    sampling = Sampling(robot, SURVIVED, seed=1)
    examiner = Examiner(robot, sampling, pairs=never)
    met = reduce(add, map(examiner, range(len(sampling.blocks)))).met
    return list(map(str, [*cells, np.count_nonzero(met)]))


SAMPLED = 100_000  # configurations beside MoveIt's files


def moveit(*files: str) -> None:
    """A row for each robot and its SRDF file, then the pairs that the file disables as "Never" although they overlap.

    Only pairs that are not adjacent count, and are modelled by convex hulls of their meshes.
    """
    heading = ["robot", "Never in the file", "proved", "overlap", "open", "not in the file, proved"]
    rows, overlaps = [], []
    for urdf, srdf in zip(files[::2], files[1::2], strict=True):
        row, wrong = moveit_of(Path(urdf), Path(srdf))
        rows.append(row)
        overlaps += wrong
    print(table(heading, rows), *overlaps, sep="\n")


def moveit_of(urdf: Path, srdf: Path) -> tuple[list[str], list[str]]:
    from overlapper.audit.prove import prove

    sampled, disabled = audit(read_robot(urdf), SAMPLED), read_srdf(srdf)
    proofs = {each.names: each for each in prove(sampled, 20_000)}
    reasons = {names: disabled.get(frozenset(names)) for names in proofs}
    never = [names for names, reason in reasons.items() if reason == "Never"]
    counts = [sum(proofs[names].verdict == verdict for names in never) for verdict in ("never", "overlaps", "open")]
    unused = sum(reason is None and proofs[names].verdict == "never" for names, reason in reasons.items())
    wrong = [
        f"{urdf.stem}: {' and '.join(each.names)} overlap in {each.met:,} of {each.asked:,} configurations, by up to "
        f"{1e3 * each.deepest.contact.depth:.3g} mm"
        for each in sampled.pairs
        if each.names in never and each.deepest
    ]
    return list(map(str, [urdf.stem, len(never), *counts, unused])), wrong


WHAT = {"speed": speed, "robots": robots, "proofs": proofs, "moveit": moveit}


def options(parser: ArgumentParser) -> None:
    parser.add_argument("what", choices=WHAT)
    parser.add_argument("given", nargs="*", help="a number of rounds, configurations or boxes; for moveit, files")


def main(chosen: Namespace) -> None:
    given = chosen.given if chosen.what == "moveit" else map(int, chosen.given)
    WHAT[chosen.what](*given)
