"""`Bodies` examines the pairs for which pybullet makes contacts, or the pairs of the user's list."""

import sys
import warnings
from itertools import combinations

import numpy as np
import pybullet as p
import pybullet_data
import pytest
from pybullet_utils.bullet_client import BulletClient
from simulated import jointed

from overlapper.simulation import Bodies, Recorder, SelfCollisionWarning
from overlapper.simulation.collision_rules import Colliders, MaskRules

SELF = p.URDF_USE_SELF_COLLISION
LINK = (
    '<link name="l{}"><inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/>'
    '</inertial><collision><geometry><box size="1 1 1"/></geometry></collision></link>'
)
JOINT = (
    '<joint name="j{0}" type="{2}"><parent link="l{1}"/><child link="l{0}"/><origin xyz=".1 0 0"/>'
    '<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
)


def box(client, mass=1, position=(0, 0, 0), **options):
    shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.5] * 3, physicsClientId=client)
    return p.createMultiBody(mass, shape, -1, position, physicsClientId=client, **options)


def chain(client, folder, joints=("revolute",) * 3, **options):
    """A robot of cubes that all overlap each other."""
    links = "".join(map(LINK.format, range(len(joints) + 1)))
    text = links + "".join(JOINT.format(i + 1, i, kind) for i, kind in enumerate(joints))
    (folder / "chain.urdf").write_text(f'<robot name="chain">{text}</robot>')
    return p.loadURDF(str(folder / "chain.urdf"), physicsClientId=client, **options)


def in_contact(client):
    """The set of pairs of links that pybullet reports as in contact."""
    p.performCollisionDetection(client)
    found = p.getContactPoints(physicsClientId=client)
    return {tuple(sorted([(each[1], each[3]), (each[2], each[4])])) for each in found}


def overlapping(bodies, **options):
    return {((c.bodyA, c.linkA), (c.bodyB, c.linkB)) for c in bodies.overlaps(**options) if c.overlap}


def agree(client, bodies):
    """The overlapping pairs, after checking that pybullet finds the same pairs."""
    found = overlapping(bodies)
    assert found == in_contact(client)
    return found


def anew(client, body, position):
    """Bullet asks its filters when boxes begin to meet."""
    p.resetBasePositionAndOrientation(body, [99, 0, 0], [0, 0, 0, 1], physicsClientId=client)
    p.performCollisionDetection(client)
    p.resetBasePositionAndOrientation(body, position, [0, 0, 0, 1], physicsClientId=client)


# --- what pybullet can be asked for


def test_static_bodies_meet_moving_ones_only(client):
    table, floor, ball = box(client, 0), box(client, 0, [0.5, 0, 0]), box(client, 1, [0, 0.5, 0])
    rigid = box(client, 0, [0, 0, 0.5], useMaximalCoordinates=True)
    assert agree(client, Bodies(client)) == {((other, -1), (ball, -1)) for other in (table, floor)} | {
        ((ball, -1), (rigid, -1))
    }


def test_a_base_that_is_fixed_or_released_is_noticed(client):
    box(client, 0)
    cube = box(client, 1, [0.5, 0, 0])
    bodies = Bodies(client)
    assert len(agree(client, bodies)) == 1
    for mass, pairs in ((0, 0), (2, 1)):
        p.changeDynamics(cube, -1, mass=mass, physicsClientId=client)
        bodies.update()
        assert len(agree(client, bodies)) == pairs


@pytest.mark.parametrize("joints", [("fixed", "revolute", "fixed"), ("revolute", "fixed", "continuous")])
@pytest.mark.parametrize("fixed", [True, False])
def test_links_of_a_robot_meet_a_table_as_in_pybullet(client, tmp_path, joints, fixed):
    box(client, 0)
    chain(client, tmp_path, joints, useFixedBase=fixed)
    assert len(agree(client, Bodies(client))) == 4 - fixed


def test_merged_links_are_one_link_of_many_shapes(client, tmp_path):
    table = box(client, 0)
    robot = chain(client, tmp_path, ("fixed", "revolute", "fixed"), flags=p.URDF_MERGE_FIXED_LINKS)
    bodies = Bodies(client)
    assert bodies.keys == [(table, -1, 0), (robot, -1, 0), (robot, -1, 1), (robot, 0, 0), (robot, 0, 1)]
    assert overlapping(bodies) == in_contact(client) == {((table, -1), (robot, link)) for link in (-1, 0)}
    assert bodies.report().pairs_possible == 4


def test_groups_and_masks_are_those_of_pybullet(client):
    """All small groups and masks at once, in every combination of two bodies."""
    filters = [(group, mask) for group in range(4) for mask in range(4)]
    bodies = [box(client, 1, [0.01 * i, 0, 0]) for i in range(len(filters))]
    for body, (group, mask) in zip(bodies, filters):
        p.setCollisionFilterGroupMask(body, -1, group, mask, physicsClientId=client)
    found = agree(client, Bodies(client))
    assert 0 < len(found) < len(filters) * (len(filters) - 1) // 2


def test_masks_of_mjcf_models_are_honoured(client, tmp_path):
    geoms = [("1", "1"), ("2", "1"), ("2", "2"), ("0", "0")]
    ball = '<body pos="{} 0 0"><freejoint/><geom type="sphere" size=".5" contype="{}" conaffinity="{}"/></body>'
    text = "".join(ball.format(0.1 * i, *each) for i, each in enumerate(geoms))
    (tmp_path / "balls.xml").write_text(f"<mujoco><worldbody>{text}</worldbody></mujoco>")
    balls = p.loadMJCF(str(tmp_path / "balls.xml"), physicsClientId=client)
    assert len(balls) == len(geoms)
    assert 0 < len(agree(client, Bodies(client))) < 6


def test_masks_of_a_model_apply_without_a_recorder(client):
    p.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
    p.loadURDF("cube_collisionfilter.urdf", physicsClientId=client)
    box(client)
    assert agree(client, Bodies(client)) == set()


def test_masks_that_change_are_noticed_with_the_next_new_body_or_at_once_by_a_recorder(client):
    first, second = box(client), box(client, 1, [0.5, 0, 0])
    with Recorder(client) as recorder:
        told, untold = Bodies(client, recorder=recorder), Bodies(client)
        p.setCollisionFilterGroupMask(first, -1, 0, 0, physicsClientId=client)
        p.setCollisionFilterGroupMask(second, -1, 0, 0, physicsClientId=client)
        told.update(), untold.update()
        assert agree(client, told) == set() and len(untold.overlaps()) == 1
    box(client, 1, [99, 0, 0])
    untold.update()
    assert untold.overlaps() == []


# --- what only a recorder knows


def test_the_filter_mode_is_noted(client, recorder):
    p.setPhysicsEngineParameter(collisionFilterMode=0, physicsClientId=client)
    for i, (group, mask) in enumerate([(1, 1), (1, 2), (2, 1), (3, 3)]):
        body = box(client, 1, [0.01 * i, 0, 0])
        p.setCollisionFilterGroupMask(body, -1, group, mask, physicsClientId=client)
    bodies = Bodies(client, recorder=recorder)
    strict = agree(client, bodies)
    p.setPhysicsEngineParameter(1 / 240, 50, collisionFilterMode=1, physicsClientId=client)
    for body in range(4):
        anew(client, body, [0.01 * body, 0, 0])
    bodies.update()
    assert strict < agree(client, bodies)


def test_pair_filters_override_masks_and_static_bodies(client, recorder):
    a, b, c = box(client), box(client, 1, [0.5, 0, 0]), box(client, 1, [0.25, 0, 0])
    tables = box(client, 0, [0, 9, 0]), box(client, 0, [0.5, 9, 0])
    p.setCollisionFilterGroupMask(c, -1, 0, 0, physicsClientId=client)
    bodies = Bodies(client, recorder=recorder)
    assert agree(client, bodies) == {((a, -1), (b, -1))}
    p.setCollisionFilterPair(b, a, -1, -1, 0, physicsClientId=client)
    p.setCollisionFilterPair(a, c, -1, -1, 1, physicsClientId=client)
    p.setCollisionFilterPair(*tables, -1, -1, enableCollision=1, physicsClientId=client)
    bodies.update()
    assert agree(client, bodies) == {((a, -1), (c, -1)), ((tables[0], -1), (tables[1], -1))}


@pytest.mark.parametrize(
    "flags",
    [
        0,
        SELF,
        SELF | p.URDF_USE_SELF_COLLISION_EXCLUDE_PARENT,
        SELF | p.URDF_USE_SELF_COLLISION_EXCLUDE_ALL_PARENTS,
        SELF | p.URDF_USE_SELF_COLLISION_INCLUDE_PARENT,
        SELF | p.URDF_USE_SELF_COLLISION_INCLUDE_PARENT | p.URDF_USE_SELF_COLLISION_EXCLUDE_ALL_PARENTS,
        p.URDF_USE_SELF_COLLISION_INCLUDE_PARENT,
    ],
)
def test_self_collision_is_as_the_flags_say(client, recorder, tmp_path, flags):
    robot = chain(client, tmp_path, flags=flags)
    bodies = Bodies(client, recorder=recorder)
    found = agree(client, bodies)
    # Which pair filters may switch off, but not on.
    p.setCollisionFilterPair(robot, robot, 2, 0, 0, physicsClientId=client)
    p.setCollisionFilterPair(robot, robot, -1, 0, 1, physicsClientId=client)
    bodies.update()
    assert agree(client, bodies) == found - {((robot, 0), (robot, 2))}


def test_branches_of_a_robot_meet_even_where_no_link_meets_its_ancestors(client, recorder):
    shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.5] * 3, physicsClientId=client)
    axes, places, flags = [[0, 1, 0]] * 4, [[0.1, 0, 0]] * 4, SELF | p.URDF_USE_SELF_COLLISION_EXCLUDE_ALL_PARENTS
    base = (1, shape, (0, 0, 0))
    robot = jointed(client, p.JOINT_REVOLUTE, shape, axes, places, [0, 1, 0, 3], base=base, flags=flags)
    found = agree(client, Bodies(client, recorder=recorder))
    assert found == {((robot, a), (robot, b)) for a in (0, 1) for b in (2, 3)}


def test_records_of_a_body_are_dropped_when_pybullet_removes_it(client, recorder, tmp_path):
    first, second = box(client), box(client, 1, [0.5, 0, 0])
    p.setCollisionFilterPair(first, second, -1, -1, 0, physicsClientId=client)
    robot = chain(client, tmp_path, flags=SELF, basePosition=[9, 0, 0])
    bodies = Bodies(client, recorder=recorder)
    assert len(agree(client, bodies)) == 3
    # A pair filter outlives its bodies, self-collision does not.
    p.removeBody(second, physicsClientId=client), p.removeBody(robot, physicsClientId=client)
    ids = chain(client, tmp_path, basePosition=[9, 0, 0]), box(client, 1, [0.5, 0, 0])
    assert set(ids) == {second, robot}
    for body, position in zip(ids, ([9, 0, 0], [0.5, 0, 0])):
        anew(client, body, position)
    bodies.update()
    assert agree(client, bodies) == (set() if ids[1] == second else {((first, -1), (ids[1], -1))})
    p.resetSimulation(physicsClientId=client)
    box(client), box(client, 1, [0.5, 0, 0])
    bodies.update()
    assert len(agree(client, bodies)) == 1


def test_a_recorder_hears_its_own_client_and_bullet_client_too(recorder):
    other = BulletClient(p.DIRECT)
    with Recorder(other._client) as theirs:
        for _ in range(2):
            other.createMultiBody(1, other.createCollisionShape(p.GEOM_SPHERE, radius=1))
        other.setCollisionFilterPair(0, 1, -1, -1, 0)
        assert theirs.pair_filters == {((0, -1), (1, -1)): False} and recorder.pair_filters == {}
        assert Bodies(other._client, recorder=theirs).overlaps() == []
        assert len(Bodies(other._client).overlaps()) == 1
        with pytest.raises(ValueError, match=f"recorder is of client {recorder.physicsClientId}, not of"):
            Bodies(other._client, recorder=recorder)
    other.disconnect()


def test_pybullet_is_as_it_was_when_the_last_recorder_is_closed(client):
    before = p.setCollisionFilterPair
    first, second = Recorder(client), Recorder(client)
    first.close()
    assert p.setCollisionFilterPair is not before
    assert p.setCollisionFilterPair.__doc__ == before.__doc__
    second.close(), second.close()
    assert p.setCollisionFilterPair is before


def test_an_error_of_pybullet_stays_one_and_is_not_noted(client, recorder):
    with pytest.raises(p.error):
        p.loadURDF("no_such_file.urdf", flags=SELF, physicsClientId=client)
    assert recorder.changes == 0


# --- the user's own choice


def test_all_pairs_of_different_bodies_are_those_of_geometry(client):
    bodies = [box(client, 0), box(client, 0, [0.5, 0, 0]), box(client)]
    p.setCollisionFilterGroupMask(bodies[2], -1, 0, 0, physicsClientId=client)
    found = Bodies(client)
    assert found.overlaps() == [] and found.report().pairs_possible == 0
    assert len(found.overlaps(pairs="all")) == found.report().pairs_possible == 3


def test_an_explicit_list_of_pairs_overrides_the_rules(client, tmp_path):
    table, robot, cube = box(client, 0), chain(client, tmp_path), box(client, 0, [0.2, 0, 0])
    bodies = Bodies(client)

    def pairs(*asked):
        found = overlapping(bodies, pairs=asked)
        assert bodies.report().pairs_possible == len(found)
        return found

    assert pairs((cube, table)) == {((table, -1), (cube, -1))}
    assert pairs(((robot, 2), table), ((robot, 2), (robot, 0))) == {
        ((table, -1), (robot, 2)),
        ((robot, 0), (robot, 2)),
    }
    assert pairs((robot, robot)) == {((robot, a), (robot, b)) for a in range(-1, 3) for b in range(a + 1, 3)}
    assert len(pairs((robot, table), (table, robot), ((robot, 1, 0), (table, -1, 0)))) == 4
    assert pairs() == pairs((table, table)) == set()
    p.removeBody(cube, physicsClientId=client)
    bodies.update()
    with pytest.raises(ValueError, match=f"pairs names body {cube}, which is not in the simulation"):
        bodies.pairs([(cube, table)])
    with pytest.raises(ValueError, match=f"pairs names link 3 of body {robot}, which it does not have"):
        bodies.pairs([((robot, 3), table)])
    with pytest.raises(ValueError, match="pairs must be 'simulated', 'all' or a list of pairs, not 'most'"):
        bodies.pairs("most")


def test_shapes_of_one_link_are_a_pair_only_by_name(client):
    shape = p.createCollisionShapeArray(
        shapeTypes=[p.GEOM_SPHERE] * 2,
        radii=[1, 1],
        halfExtents=[[1, 1, 1]] * 2,
        lengths=[1, 1],
        collisionFramePositions=[[0, 0, 0], [1, 0, 0]],
        physicsClientId=client,
    )
    body = p.createMultiBody(1, shape, physicsClientId=client)
    bodies = Bodies(client)
    assert bodies.pairs([(body, body)]).tolist() == []
    assert bodies.pairs([((body, -1, 1), (body, -1, 0))]).tolist() == [[0, 1]]


def test_possible_pairs_are_counted_as_they_would_be_found(client, recorder, tmp_path):
    """All bodies overlap each other, so every pair is examined."""
    for i, (group, mask) in enumerate([(1, -1), (2, 1), (2, 2), (4, 3), (0, 0)]):
        shape = p.createCollisionShapeArray(
            shapeTypes=[p.GEOM_SPHERE] * (i + 1),
            radii=[1] * (i + 1),
            halfExtents=[[1, 1, 1]] * (i + 1),
            lengths=[1] * (i + 1),
            collisionFramePositions=[[0.01 * j, 0, 0] for j in range(i + 1)],
            physicsClientId=client,
        )
        body = p.createMultiBody(i % 3, shape, physicsClientId=client)
        p.setCollisionFilterGroupMask(body, -1, group, mask, physicsClientId=client)
    robot = chain(client, tmp_path, flags=SELF)
    other = chain(client, tmp_path, useFixedBase=True)
    p.setCollisionFilterPair(robot, robot, -1, 2, 0, physicsClientId=client)
    p.setCollisionFilterPair(other, robot, 1, 0, 0, physicsClientId=client)
    p.setCollisionFilterPair(4, 3, -1, -1, 1, physicsClientId=client)
    p.setCollisionFilterPair(4, 3, 7, -1, 1, physicsClientId=client)  # of a link that is not there
    bodies = Bodies(client, recorder=recorder)
    for among in ("simulated", "all", [(robot, robot), (0, robot), (3, 4), (4, 3)]):
        found = len(bodies.overlaps(pairs=among))
        assert bodies.report().pairs_possible == bodies.report().pairs_examined == found > 0


def test_only_pairs_whose_boxes_meet_are_candidates(client):
    box(client), box(client, 1, [0.5, 0, 0]), box(client, 1, [9, 0, 0])
    pairs = Bodies(client).pairs()
    assert pairs.tolist() == [[0, 1]] and pairs.dtype == np.int32


def test_many_pair_filters_are_checked_in_one_pass(client, recorder):
    cubes = [box(client, position=[0.9 * x, 0, 0]) for x in range(40)]
    bodies = Bodies(client, recorder=recorder)

    def work():
        """How many functions are called to choose pairs."""
        calls = []
        bodies.update()
        sys.setprofile(lambda frame, event, argument: calls.append(event))
        try:
            found = bodies.pairs()
        finally:
            sys.setprofile(None)
        return len(found), len(calls)

    def forbid(pairs):
        for i, j in pairs:
            p.setCollisionFilterPair(cubes[i], cubes[j], -1, -1, 0, physicsClientId=client)
        return work()

    assert work()[0] == 39
    (few, some), (none, many) = forbid([(0, 1)]), forbid([(i, j) for j in range(40) for i in range(j)])
    assert (few, none) == (38, 0) and many == some


# --- what no recorder has heard of


def test_a_body_that_collides_with_itself_unrecorded_is_named_once(client, tmp_path):
    robot = chain(client, tmp_path, flags=SELF)
    bodies = Bodies(client)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert bodies.overlaps() == []  # and pybullet has not looked for contacts yet
        p.performCollisionDetection(client)
        assert bodies.overlaps(pairs=[(robot, robot)]) != []  # asked for as the warning says
    with pytest.warns(SelfCollisionWarning, match=r"collides with itself \(l. with l.\), .*Recorder") as told:
        assert bodies.overlaps() == []
    assert len(told) == 1 and told[0].filename == __file__ and f"pairs=[({robot}, {robot})]" in str(told[0].message)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bodies.update()
        bodies.overlaps()
    p.removeBody(robot, physicsClientId=client)
    assert chain(client, tmp_path, flags=SELF) == robot
    p.performCollisionDetection(client)
    bodies.update()
    with pytest.warns(SelfCollisionWarning):
        bodies.overlaps()


def test_a_recorder_that_came_too_late_does_not_silence_the_warning(client, tmp_path):
    early = chain(client, tmp_path, flags=SELF)
    with Recorder(client) as recorder:
        late = chain(client, tmp_path, flags=SELF, basePosition=[9, 0, 0])
        bodies = Bodies(client, recorder=recorder)
        p.performCollisionDetection(client)
        with pytest.warns(SelfCollisionWarning, match=f"body {early}") as told:
            contacts = bodies.overlaps()
        assert len(told) == 1 and {(c.bodyA, c.bodyB) for c in contacts} == {(late, late)}


def test_contacts_are_asked_only_of_bodies_that_could_collide_with_themselves(client, tmp_path, monkeypatch):
    for x in range(10):
        box(client, position=(2 * x, 0, 0))
    robot = chain(client, tmp_path, basePosition=[0, 9, 0])
    bodies, asked, original = Bodies(client), [], p.getContactPoints
    monkeypatch.setattr(p, "getContactPoints", lambda *args, **named: (asked.append(args), original(*args, **named))[1])
    for _ in range(3):
        bodies.overlaps()
    assert asked == [(robot, robot)] * 3


@pytest.mark.parametrize("seed", range(5))
def test_rules_count_the_pairs_that_they_allow(seed):
    """With many pair filters and bodies that collide with themselves, pair by pair."""
    random = np.random.default_rng(seed)
    links = sorted({(int(body), int(link)) for body, link in random.integers([0, -1], [6, 3], (20, 2))})
    rows = {each: row for row, each in enumerate(links)}
    owners = np.array([body for body, _ in links])
    group, mask = random.choice([1, 2, 3], len(links)), random.choice([0, 1, -1, -3], len(links))

    drawn = [(links[i], links[j]) for i, j in random.integers(0, len(links), (30, 2)) if i != j]
    both = bool(seed % 2)
    filters = {tuple(sorted(pair)): bool(random.integers(2)) for pair in drawn} | {((77, -1), (88, -1)): True}
    within = [(a, b) for a, b in combinations(links, 2) if a[0] == b[0] in (1, 4)]
    rules = MaskRules(Colliders(rows, owners, group, mask), both, filters, within)
    weights, expected = random.integers(1, 4, len(links)), 0
    first, second = np.triu_indices(len(links), 1)
    for i, j, allowed in zip(first, second, rules.allow(first, second)):
        admitted, admitting = group[i] & mask[j] != 0, group[j] & mask[i] != 0
        should = (admitted and admitting) if both else (admitted or admitting)
        should = filters.get((links[i], links[j]), should)
        if owners[i] == owners[j]:
            should = should and owners[i] in (1, 4)
        assert bool(allowed) == bool(should), (links[i], links[j])
        expected += int(weights[i] * weights[j]) * bool(allowed)
    assert rules.count(weights) == expected


def test_pairs_are_asked_for_by_name_and_one_pair_without_a_list(client, tmp_path):
    p.setAdditionalSearchPath(pybullet_data.getDataPath(), physicsClientId=client)
    plane = p.loadURDF("plane.urdf", physicsClientId=client)
    robot = chain(client, tmp_path)
    bodies = Bodies(client)
    of_all = [(each.bodyA, each.linkA, each.bodyB, each.linkB) for each in bodies.overlaps(pairs=[(plane, robot)])]
    assert len(of_all) == 4
    for pairs in ((plane, robot), [plane, robot], ("plane", "chain"), [("plane", robot)], [("chain", "plane")]):
        found = bodies.overlaps(pairs=pairs)
        assert [(each.bodyA, each.linkA, each.bodyB, each.linkB) for each in found] == of_all
        assert len(bodies.pairs(pairs)) == 4 and bodies.report().pairs_possible == 4
    (one,) = bodies.overlaps(pairs=("plane", "chain/l2"))
    assert (one.bodyB, one.linkB) == (robot, 1)
    assert len(bodies.overlaps(pairs=("chain/l0", "chain/l3"))) == 1


@pytest.mark.parametrize("pairs", [5, None, ["plane"], (0,), (0, 1.5), [("a", "b", "c")], [0, 1, 2], [5, (0, 1)]])
def test_an_invalid_list_of_pairs_is_refused(client, pairs):
    box(client)
    with pytest.raises(ValueError, match=r"^pairs must be 'simulated', 'all' or a list of pairs, not "):
        Bodies(client).overlaps(pairs=pairs)


def test_a_name_that_nobody_has_is_refused_with_the_nearest_one(client, tmp_path):
    chain(client, tmp_path)
    bodies = Bodies(client)
    with pytest.raises(
        ValueError, match=r"^pairs names 'chaim', which is not a body or link in the simulation; 'chain' is$"
    ):
        bodies.overlaps(pairs=[("chaim", "chain")])
    with pytest.raises(ValueError, match=r"^pairs names 'xyz', which is not a body or link in the simulation$"):
        bodies.pairs(("xyz", "chain"))
