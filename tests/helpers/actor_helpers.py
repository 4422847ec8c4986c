"""Rounding errors of an actor's network, derived from its weights."""

import numpy as np

from agents.policy.actor import Actor
from agents.policy.features import features

EPS = float(np.finfo(np.float32).eps)
FUNCTION_ULPS = 4
"""Relative error, in EPS, of a library's float32 tanh, expm1 or pow; glibc, SLEEF and MLAS promise less."""
ACTIVATIONS = {"tanh": np.tanh, "relu": lambda x: np.maximum(x, 0), "elu": lambda x: np.where(x > 0, x, np.expm1(x))}
SQUASHES = {"tanh": np.tanh, "clip": lambda x: np.clip(x, -1, 1)}


SIGMAS = 8
"""Tolerance in standard deviations; 1e-15 of normally distributed errors are larger, and some are not quite normal."""


def rounding_bound(actor: Actor, observations: np.ndarray) -> np.ndarray:
    """Largest difference (rows, 3) to expect of two float32 evaluations of an actor, whatever the order of their sums.

    Probabilistic error analysis (Higham & Mary 2019): rounding errors are independent, so a sum of n products errs by
    about sqrt(n) EPS / 2 times the root sum of squares of its terms, and errors of the inputs add up as squares. (The
    worst case, n in place of sqrt(n) and sums of magnitudes, is hundreds of times as large after three layers.)
    Activations and squashes have slopes of at most 1; the power's is p |z|^(p - 1).
    """
    x = features(np.asarray(observations, np.float32), actor.functions.magnification).astype(float)
    variance = np.zeros_like(x)
    for index, (weight, bias) in enumerate(actor.layers):
        squares, terms = weight.astype(float) ** 2, weight.shape[1] + 1
        variance = variance @ squares.T + terms * EPS**2 * (x**2 @ squares.T + bias.astype(float) ** 2)
        last = index == len(actor.layers) - 1
        function = SQUASHES[actor.functions.squash] if last else ACTIVATIONS[actor.functions.activation]
        x = function(x @ weight.T.astype(float) + bias)
        variance = variance + (FUNCTION_ULPS * EPS * x) ** 2
    power, error = actor.functions.throttle_power, SIGMAS * np.sqrt(variance)
    largest = np.minimum(np.abs(x) + error, 1)
    return power * largest ** (power - 1) * error + FUNCTION_ULPS * EPS * largest**power


def assert_equal_up_to_rounding(actual: np.ndarray, expected: np.ndarray, bound: np.ndarray) -> None:
    """Check two evaluations against `rounding_bound`, which must itself be small beside actions of order 1."""
    assert bound.max() < 1e-3
    np.testing.assert_array_less(np.abs(actual.astype(float) - expected), np.maximum(bound, np.finfo(float).tiny))
