"""Tables looked up by instant, and affine laws of them: the same as numpy's indexing and as the law spelled out."""

import numpy as np
import pytest

from baselines.controllers.affine_law import AffineLaw, reference_table, shown
from baselines.controllers.lookup import look_up, look_up_times
from baselines.design.guidance import Guidance
from formation_env import FormationVectorEnv, load_scenario

PHASES, STEPS, ROWS = 3, 5, 40


def instants(rng: np.random.Generator, *shape: int) -> tuple[np.ndarray, np.ndarray]:
    """Random phases and steps left (*shape)."""
    return rng.integers(PHASES, size=shape), rng.integers(STEPS, size=shape)


@pytest.mark.parametrize("shape", [(), (ROWS,), (4, 5)], ids=str)
def test_look_ups_are_numpys_indexing(shape: tuple[int, ...]) -> None:
    """For one row, a batch and a grid of rows at different instants; the sums of six products may be rounded apart."""
    rng = np.random.default_rng(0)
    table, at, vectors = rng.normal(size=(PHASES, STEPS, 3, 6)), instants(rng, *shape), rng.normal(size=(*shape, 6))
    np.testing.assert_array_equal(look_up(table, at), table[at])
    products = look_up_times(table, at, vectors)
    assert products.shape == (*shape, 3)
    np.testing.assert_allclose(products, (table[at] @ vectors[..., None])[..., 0], rtol=0, atol=1e-14)


def test_a_rows_product_does_not_depend_on_its_batch() -> None:
    """Alone or among others, the same bits, so that an episode's result does not depend on those flown beside it."""
    rng = np.random.default_rng(1)
    table, at, vectors = rng.normal(size=(PHASES, STEPS, 3, 6)), instants(rng, ROWS), rng.normal(size=(ROWS, 6))
    together = look_up_times(table, at, vectors)
    alone = [look_up_times(table, (at[0][i], at[1][i]), vectors[i]) for i in range(ROWS)]
    np.testing.assert_array_equal(together, alone)


@pytest.mark.parametrize("phase", [-1, PHASES])
def test_phases_outside_a_table_are_refused(phase: int) -> None:
    """Compiled code would read foreign memory."""
    table, at = np.ones((PHASES, STEPS, 3, 6)), (np.array([0, phase]), np.array([0, 0]))
    with pytest.raises(IndexError, match="outside the table"):
        look_up_times(table, at, np.ones((2, 6)))


def test_an_affine_law_is_the_law_spelled_out() -> None:
    """u = u_d - K (x_hat - x_d) with the error from `Guidance`, in a transfer, where path and reference differ.

    The law adds the same products in another order: 1e-12 of the greatest of them.
    """
    scenario, rng = load_scenario("initialization"), np.random.default_rng(2)
    guidance = Guidance(scenario, "straight_line")
    K, thrust = rng.normal(size=(*guidance.desired.shape[:2], 3, 6)), rng.normal(size=(*guidance.desired.shape[:2], 3))
    law = AffineLaw(scenario, K, guidance.desired - reference_table(scenario), thrust)
    observation, _ = FormationVectorEnv(2, scenario).reset(seed=0)
    now = guidance.track(observation)
    expected = thrust[now.at] - (K[now.at] @ now.error[..., None])[..., 0]
    got = law.acceleration(shown(observation, "error"), law.instants(observation))
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-12 * np.abs(guidance.desired).max())


@pytest.mark.parametrize("name", ["two_impulse", "deadband"])
def test_rows_in_transfer_and_in_hold_share_a_batch(name: str) -> None:
    """Each row gets the law that it gets alone, whichever the others are in."""
    from baselines import make_policy

    policy, env = make_policy(name, "initialization"), FormationVectorEnv(3, "initialization")
    leaving, _ = env.reset(seed=0)
    seen = leaving
    for _ in range(100):
        seen = env.step(policy.predict(seen)[0])[0]
    mixed = np.concatenate([leaving, seen])[[0, 3, 1, 4, 2, 5]]
    np.testing.assert_array_equal(policy.acceleration(mixed), [policy.acceleration(row) for row in mixed])
