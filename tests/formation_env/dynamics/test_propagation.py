"""The free function that propagates relative states."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from oracles import hcw_state_matrix
from scipy.linalg import expm

from formation_env.dynamics import DYNAMICS
from formation_env.dynamics.perturbations import Perturbations
from formation_env.dynamics.propagation import propagate
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.orbital.orbit import Orbit

CIRCLE = [2000.0, 369.3, 3464.1, 0.2, -4.33, 0.346]
LEADER = Spacecraft(area_m2=0.5)
NO_AIR = Spacecraft(air_density_kg_m3=0.0)
dynamics = st.sampled_from(sorted(DYNAMICS))
times = st.floats(-20000, 20000)
# Positions to 10 km and velocities to 10 m/s.
relative_states = arrays(float, 6, elements=st.floats(-1, 1)).map(lambda unit: unit * ([1e4] * 3 + [10.0] * 3))
# Values reach 1e4 m + 3 * 2e4 s * (10 m/s + 6 n 1e4 m) = 5e6; rounding of a few hundred operations is 1e-7 at most.
ROUNDING_M = 1e-6


def test_default_is_the_modified_model_of_the_thesis() -> None:
    """Left out, the arguments are the thesis's orbit, follower, and a leader like the follower."""
    named = propagate(
        CIRCLE,
        [100.0],
        dynamics="modified_hcw",
        orbit=Orbit(altitude_m=600e3, inclination_deg=60.0),
        spacecraft=Spacecraft(mass_kg=50.0, area_m2=0.16, drag_coefficient=1.0, air_density_kg_m3=1.04e-13),
        leader_spacecraft=Spacecraft(),
    )
    np.testing.assert_array_equal(propagate(CIRCLE, [100.0]), named)


def test_hcw_is_the_matrix_exponential() -> None:
    """An HCW state after t is exp(A t) times the first; rounding of some km."""
    orbit = Orbit()
    expected = expm(hcw_state_matrix(orbit.mean_motion_rad_s) * 4000.0) @ CIRCLE
    np.testing.assert_allclose(propagate(CIRCLE, [4000.0], dynamics="hcw")[0], expected, rtol=0, atol=1e-8)


@pytest.mark.parametrize("batch", [(), (1,), (3,), (2, 3), (0,)])
def test_shapes(batch: tuple[int, ...]) -> None:
    """States (..., 6) at times (T,) give (..., T, 6), for empty batches and no times, too."""
    assert propagate(np.zeros((*batch, 6)), [0.0, 1.0, 2.0, 3.0]).shape == (*batch, 4, 6)
    assert propagate(np.zeros((*batch, 6)), []).shape == (*batch, 0, 6)


def test_batch_equals_loop() -> None:
    """Rows and instants of a batch do not influence each other."""
    states = np.random.default_rng(1).normal(size=(3, 6)) * 1000
    instants = [0.0, 60.0, 5000.0]
    together = propagate(states, instants, leader_spacecraft=LEADER)
    for i, state in enumerate(states):
        for j, instant in enumerate(instants):
            alone = propagate(state, [instant], leader_spacecraft=LEADER)[0]
            # einsum may add in another order: one rounding of values up to 1e7.
            np.testing.assert_allclose(together[i, j], alone, rtol=1e-13, atol=1e-8)


@given(relative_states, times, times, dynamics)
def test_two_spans_are_one(state: np.ndarray, first_s: float, second_s: float, name: str) -> None:
    """A flow is a semigroup: t1 and then t2 is t1 + t2, with disturbance, forwards and backwards."""
    middle = propagate(state, [first_s], dynamics=name, leader_spacecraft=LEADER)[0]
    stepped = propagate(middle, [second_s], dynamics=name, leader_spacecraft=LEADER)[0]
    whole = propagate(state, [first_s + second_s], dynamics=name, leader_spacecraft=LEADER)[0]
    # The second span multiplies the first one's rounding by up to 6 n t = 130.
    np.testing.assert_allclose(stepped, whole, rtol=0, atol=130 * ROUNDING_M)


@given(relative_states, relative_states, st.floats(-3, 3), times, dynamics)
def test_superposition(first: np.ndarray, second: np.ndarray, factor: float, time_s: float, name: str) -> None:
    """Without a disturbance the model is linear in the state."""
    a, b, both = propagate([first, second, first + factor * second], [time_s], dynamics=name)[:, 0]
    np.testing.assert_allclose(both, a + factor * b, rtol=0, atol=10 * ROUNDING_M)


@given(relative_states, relative_states, times)
def test_disturbance_is_the_same_for_all_states(first: np.ndarray, second: np.ndarray, time_s: float) -> None:
    """A leader with other drag shifts every path by the same."""
    pair = [first, second]
    shift = propagate(pair, [time_s], leader_spacecraft=LEADER) - propagate(pair, [time_s])
    np.testing.assert_allclose(shift[0], shift[1], rtol=0, atol=10 * ROUNDING_M)


def test_a_leader_with_more_drag_leaves_its_follower_behind() -> None:
    """HCW under a constant along-track acceleration a, by hand; J2 and the follower's own drag change 1e-3 of it."""
    orbit, time_s = Orbit(), 4000.0
    n = orbit.mean_motion_rad_s
    a = 0.5 * 1.04e-13 * (n * orbit.radius_m) ** 2 * (0.5 - 0.16) / 50
    x, y, *_ = propagate(np.zeros(6), [time_s], leader_spacecraft=LEADER)[0]
    assert x == pytest.approx(2 * a / n**2 * (n * time_s - np.sin(n * time_s)), rel=2e-3)
    assert y == pytest.approx(a * (4 / n**2 * (1 - np.cos(n * time_s)) - 1.5 * time_s**2), rel=2e-3)


@given(relative_states, st.permutations([-300.0, 0.0, 0.5, 60.0, 60.0, 7000.0]), dynamics)
def test_times_in_any_order(state: np.ndarray, shuffled: list[float], name: str) -> None:
    """Each instant's state does not depend on its neighbours, and at t = 0 it is the initial one."""
    order = np.argsort(shuffled)
    path = propagate(state, shuffled, dynamics=name)
    np.testing.assert_array_equal(path[order], propagate(state, np.sort(shuffled), dynamics=name))
    np.testing.assert_allclose(path[shuffled.index(0.0)], state, rtol=0, atol=ROUNDING_M)


@pytest.mark.parametrize(
    ("state", "instants", "argument"),
    [
        (np.zeros(5), [0.0], "initial_state"),
        (np.zeros((6, 2)), [0.0], "initial_state"),
        (1.0, [0.0], "initial_state"),
        ([np.nan] * 6, [0.0], "initial_state"),
        (np.zeros(6), 1.0, "times_s"),
        (np.zeros(6), [[0.0]], "times_s"),
        (np.zeros(6), [0.0, np.inf], "times_s"),
    ],
)
def test_wrong_arrays_are_refused_by_name(state: object, instants: object, argument: str) -> None:
    """A wrong shape or a number that is not finite names its argument."""
    with pytest.raises(ValueError, match=rf"^{argument} must be finite with shape"):
        propagate(state, instants)  # type: ignore[arg-type]


def test_unknown_model_is_refused() -> None:
    """The name of the model is checked, too."""
    with pytest.raises(ValueError, match=r"no model named 'kepler'; known: hcw, .*, yamanaka_ankersen"):
        propagate(CIRCLE, [0.0], dynamics="kepler")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"dynamics": "hcw", "orbit": Orbit(altitude_m=2e6, eccentricity=0.1)}, "dynamics: hcw is for circular orbits"),
        (
            {"dynamics": "modified_hcw", "perturbations": Perturbations(sun=True)},
            "perturbations: act in the truth nonlin",
        ),
    ],
)
def test_what_a_scenario_refuses_is_refused_here(arguments: dict[str, object], message: str) -> None:
    """A circular model about an ellipse was kilometres off; perturbations of a linear model did nothing."""
    with pytest.raises(ValueError, match=message):
        propagate(CIRCLE, [0.0], **arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize("batch", [(), (2, 3), (0,)])
def test_shapes_of_the_nonlinear_truth(batch: tuple[int, ...]) -> None:
    """Empty batches and no times are allowed."""
    states = np.zeros((*batch, 6))
    assert propagate(states, [-5.0, 0.0, 10.0], dynamics="nonlinear").shape == (*batch, 3, 6)
    assert propagate(states, [], dynamics="nonlinear").shape == (*batch, 0, 6)
    assert propagate(states, [0.0], dynamics="nonlinear").shape == (*batch, 1, 6)


def test_a_follower_that_falls_is_an_error() -> None:
    """By vis-viva a brake of 300 m/s at 600 km lowers the perigee to below the ground within half an orbit."""
    with pytest.raises(ValueError, match="follower: re-enters at t = "):
        propagate([0, 0, 0, 0, -300.0, 0], [6000.0], dynamics="nonlinear")
    with pytest.raises(ValueError, match=r"follower: must start above 80000 m, got -400000"):
        propagate([-1e6, 0, 0, 0, 0, 0], [10.0], dynamics="nonlinear")
