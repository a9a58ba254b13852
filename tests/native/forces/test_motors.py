"""Motors of joints as parts of the bodies that contacts push: their laws, and the laws of contact beside them."""

from dataclasses import replace

import numpy as np
import pytest
from mechanics import REVOLUTE, Link, Links, Scene, broken_laws
from test_contact_laws import scene

from overlapper import Box, HalfSpace, Placed

JOINTS = [6, 7, 8, 9, 10, 17, 18, 19, 20, 21]  # coordinates of the arm and of the branched body, in scenes at random
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
H, G, MOST = 1 / 240, 9.81, 1e3


def motors(seed):
    """Motors of some joints, with all kinds of gains and limits."""
    rng = np.random.default_rng(seed)
    which = rng.permutation(JOINTS)[: rng.integers(1, len(JOINTS))]
    return [(c, rng.normal(scale=0.1), rng.choice([0, 0.1, 0.9, 1, 1]), 10 ** rng.uniform(-3, 3)) for c in which]


@pytest.mark.parametrize("seed", range(40))
def test_motors_hold_with_at_most_their_largest_force_beside_contacts(seed):
    found = replace(scene(seed, rounds=40), motors=motors(seed)).solve()
    assert broken_laws(found, 1e-6) == []


def hammer(**given):
    """A head of 1 kg at the end of an arm of 1 m, 1 mm deep in the floor; the arm turns about y without mass."""
    links = [Link(mass=0), Link(0, REVOLUTE, (0, 1, 0), (0, 0, 0), 1, (1e-3,) * 3)]
    placed = Links(links, np.array([(0, 0, 0.05), (1, 0, 0.05)]), np.array([UPRIGHT] * 2))
    shapes = [Placed(HalfSpace([0, 0, 1], 1e-3)), Placed(Box([0.05] * 3), (1, 0, 0.05))]
    return Scene(placed, shapes, [0, 1], [(1, 0)], **{"friction": 0.0} | given)


def test_a_motor_gives_its_coordinate_the_velocity_of_its_target_whatever_pushes():
    found = hammer(motors=[(6, 0.25, 1, MOST)], acceleration=[0] * 6 + [7.0]).solve()
    assert found.velocity[6] == pytest.approx(0.25, rel=1e-12)
    stronger = hammer(motors=[(6, 0.25, 1, MOST)], stiffness=1e7).solve()
    assert stronger.velocity[6] == pytest.approx(0.25, rel=1e-12)
    assert stronger.force[0, 2] > 50 * found.force[0, 2]


@pytest.mark.parametrize("gain", [0.3, 0.9])
def test_a_motor_alone_leaves_a_part_of_the_velocity_by_its_gain(gain):
    apart = {"velocity": [0] * 6 + [0.5], "stiffness": 1e-9}
    found = hammer(motors=[(6, 0.2, gain, MOST)], **apart).solve()
    assert found.velocity[6] == pytest.approx((1 - gain) * 0.5 + 0.2, rel=1e-9)


@pytest.mark.parametrize("forwards", [1, -1])
def test_a_motor_pushes_with_its_largest_force_if_that_does_not_suffice(forwards):
    """The next step begins with this force. Where a smaller force suffices, the motor holds again."""
    inertia = 1 + 1e-3
    weak = hammer(motors=[(6, forwards * 9.0, 1, 3.0)], stiffness=1e-9)
    for _ in range(2):
        assert weak.solve().velocity[6] == pytest.approx(forwards * 3 * H / inertia, rel=1e-9)
    close = replace(weak, motors=[(6, forwards * 1e-3, 1, 3.0)])
    near = weak.solver.solve(H, np.zeros(7), np.zeros(7), None, False, motors=close.motors)[7]
    assert H * near[6] == pytest.approx(forwards * 1e-3, rel=1e-9)


def test_motors_change_nothing_for_the_next_step_without_them():
    """A step with motors leaves the masses as they were."""
    alone, after = hammer(), hammer(motors=[(6, 0.1, 1, MOST)])
    after.solve()
    first = alone.solve()
    told = after.solver.solve(H, np.zeros(7), np.zeros(7), None, False)
    assert told[7] == pytest.approx(first.acceleration, rel=1e-9)


def test_a_motor_of_what_moves_no_mass_does_nothing():
    found = hammer(motors=[(0, 0.1, 1, MOST), (6, 0.0, 1, MOST)]).solve()
    assert not found.acceleration[:6].any()


@pytest.mark.parametrize(
    ("motors", "says"),
    [
        ([1, 2, 3], "motors must have 4 numbers in a row"),
        ([[7, 0, 1, 1]], "motors must begin with coordinates"),
        ([[-1, 0, 1, 1]], "motors must begin with coordinates"),
        ([[6, np.nan, 1, 1]], "motors must have a finite target, a gain from 0 to 1 and a limit from 0"),
        ([[6, 0, 1.5, 1]], "motors must have a finite target, a gain from 0 to 1 and a limit from 0"),
        ([[6, 0, -0.5, 1]], "motors must have a finite target, a gain from 0 to 1 and a limit from 0"),
        ([[6, 0, 1, -1]], "motors must have a finite target, a gain from 0 to 1 and a limit from 0"),
    ],
)
def test_motors_that_are_none_are_refused(motors, says):
    with pytest.raises(ValueError, match=f"^{says}$"):
        hammer(motors=motors).solve()
