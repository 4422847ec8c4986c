"""Slots of formations: places of several followers on one formation."""

import numpy as np
import pytest

from formation_env import Orbit
from formation_env.formations import Following, Listed, ProjectedCircle, SpaceCircle, Train, XYEllipse

ORBIT = Orbit()


@pytest.mark.parametrize("formation", [SpaceCircle(), ProjectedCircle(x0_m=300.0), XYEllipse(vx0_m_s=0.4)])
def test_slots_on_a_closed_path_follow_each_other_in_equal_times(formation: SpaceCircle) -> None:
    """Slot i stands where the formation's own path leads in i / count of a period (closed form of HCW)."""
    times_s = np.arange(5) * ORBIT.period_s / 5
    path = formation.reference(times_s, ORBIT)
    states = [slot.state(ORBIT) for slot in formation.slots(5, ORBIT)]
    np.testing.assert_allclose(states, path, rtol=1e-9, atol=1e-9)


def test_slots_on_the_space_circle_are_a_regular_polygon() -> None:
    """Equal distances to the leader, 2 r sin(pi / N) from each to the next."""
    places = np.array([slot.state(ORBIT)[:3] for slot in SpaceCircle(x0_m=250.0, vx0_m_s=0.0).slots(8, ORBIT)])
    np.testing.assert_allclose(np.linalg.norm(places, axis=1), 500.0, rtol=1e-12)
    sides = np.linalg.norm(places - np.roll(places, 1, axis=0), axis=1)
    np.testing.assert_allclose(sides, 1000 * np.sin(np.pi / 8), rtol=1e-12)


def test_train_is_a_row_of_followers() -> None:
    states = [slot.state(ORBIT) for slot in Train(y0_m=-500.0, spacing_m=-100.0).slots(3, ORBIT)]
    np.testing.assert_array_equal(np.array(states)[:, 1], [-500, -600, -700])


def test_list_gives_each_its_own() -> None:
    own = (Following(y0_m=100.0), SpaceCircle())
    assert Listed(formations=own).slots(2, ORBIT) == own
    with pytest.raises(ValueError, match="formations: must have 3, one for each follower, got 2"):
        Listed(formations=own).slots(3, ORBIT)


def test_one_follower_has_the_formation_itself() -> None:
    assert Following().slots(1, ORBIT) == (Following(),)
    with pytest.raises(ValueError, match="has one place for 2 followers"):
        Following().slots(2, ORBIT)
