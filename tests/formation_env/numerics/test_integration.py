"""Bounded integration, against closed forms."""

import numpy as np
import pytest

from formation_env.numerics.arrays import Array
from formation_env.numerics.integration import IntegrationError, integrate

SETTINGS = {"start_s": 0.0, "period_s": 1.0, "rtol": 1e-10, "atol": 1e-12}


def decay(_: float, y: Array) -> Array:
    return -y


def test_a_decay_is_the_exponential() -> None:
    """Forwards and backwards, from the start itself on."""
    for sign in (1.0, -1.0):
        times = sign * np.linspace(0, 2, 5)
        states = integrate(decay, np.array([1.0, 2.0]), times, **SETTINGS)  # type: ignore[arg-type]
        np.testing.assert_allclose(states, np.exp(-times)[:, None] * [1.0, 2.0], rtol=1e-9)


def test_the_start_alone() -> None:
    np.testing.assert_array_equal(integrate(decay, np.ones(2), np.zeros(3), **SETTINGS), np.ones((3, 2)))  # type: ignore[arg-type]
    assert integrate(decay, np.ones(2), np.zeros(0), **SETTINGS).shape == (0, 2)  # type: ignore[arg-type]


def test_a_fall_ends_where_the_height_is_0() -> None:
    """y = 1 - t^2 / 2 from rest: at t = sqrt 2."""
    with pytest.raises(IntegrationError, match=r"end of the motion at t = 1\.41421 s") as error:
        integrate(
            lambda _, y: np.array([y[1], -1.0]),
            np.array([1.0, 0.0]),
            np.array([10.0]),
            height=lambda _, y: y[0],
            **SETTINGS,  # type: ignore[arg-type]
        )
    assert error.value.time_s == pytest.approx(np.sqrt(2), rel=1e-9)


def test_a_stiff_motion_is_given_up() -> None:
    """A rate of 1e9 per unit of time takes 1e9 steps; the bound is 20 000 evaluations."""
    with pytest.raises(IntegrationError, match="too many steps at t = "):
        integrate(lambda t, y: -1e9 * (y - np.cos(t)), np.ones(1), np.array([1.0]), **SETTINGS)  # type: ignore[arg-type]


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_rates_that_are_not_finite_are_refused(bad: float) -> None:
    with pytest.raises(IntegrationError, match="rates that are not finite at t = "):
        integrate(lambda t, y: y if t < 0.5 else y * bad, np.ones(1), np.array([1.0]), **SETTINGS)  # type: ignore[arg-type]
