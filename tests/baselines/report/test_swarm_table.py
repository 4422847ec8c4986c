"""The comparison of policies for several followers."""

import pandas as pd
import pytest
from scipy.stats import beta

from baselines.experiments.swarm_episodes import fly_groups, per_thousand, with_outages
from baselines.report.swarm_table import COLUMNS, outage_table, swarm_table
from baselines.swarm.registry import make_swarm_policy
from formation_env import FormationSwarmEnv, load_scenario


def test_a_group_is_flown_as_by_hand() -> None:
    """Cost, violations and least distance of a seed are those of the environment itself."""
    scenario = load_scenario("swap")
    policy = make_swarm_policy("leader_follower", scenario)
    flown = fly_groups(policy, scenario, [5, 6])
    env = FormationSwarmEnv(scenario)
    observations, info = env.reset(seed=6)
    ended, total, violations, least = False, 0.0, 0.0, info["least_distance_m"].min()
    while not ended:
        observations, reward, terminated, truncated, info = env.step(policy.predict(observations)[0])
        ended, total, violations = terminated or truncated, total + reward, violations + info["cost"].sum()
        least = min(least, info["least_distance_m"].min())
    line = flown.set_index("seed").loc[6]
    assert line["cost_m_s"] == pytest.approx(-total, rel=1e-3)  # actions of a batch differ by rounding
    assert line["violating_steps"] == pytest.approx(violations, abs=2)
    assert line["least_distance_m"] == pytest.approx(least, abs=0.5)


def test_rates_have_exact_intervals() -> None:
    """Clopper and Pearson's by the beta distribution."""
    rate, low, high = per_thousand(pd.Series([True] * 3 + [False] * 47))
    assert rate == pytest.approx(60.0)
    assert low == pytest.approx(1000 * beta.ppf(0.025, 3, 48), rel=1e-6)
    assert high == pytest.approx(1000 * beta.ppf(0.975, 4, 47), rel=1e-6)
    assert per_thousand(pd.Series([False] * 20))[:2] == (0.0, 0.0)


def test_tables_have_a_line_for_each_policy() -> None:
    """With the difference to the plain policy only where there is avoidance."""
    policies = (("leader_follower", "none"), ("mimo", "none"), ("leader_follower", "cbf"))
    table = swarm_table(["swap"], 2, policies)
    assert [row[1:3] for row in table.rows] == list(policies)
    more, over_scp = COLUMNS.index("more than without avoidance, m/s"), COLUMNS.index("more than scp, m/s")
    assert [row[more] is None for row in table.rows] == [True, True, False]
    assert [row[over_scp] for row in table.rows] == [None, None, None]
    grown = outage_table(["swap"], 1, [60.0, 1200.0])
    assert len(grown.rows) == 8
    assert "outages of 1200 s" in grown.markdown()


def test_outages_grow() -> None:
    """The share of time that a link is down, by its chain."""
    scenario = load_scenario("swap")
    losses = [
        with_outages(scenario, length).inter_satellite_link.dropout.chain(scenario.dt_s, scenario.orbit).stationary_loss
        for length in (60.0, 600.0, 6000.0)
    ]
    assert losses == sorted(losses)
    assert losses[1] == pytest.approx(600 / (600 + scenario.orbit.period_s), rel=0.01)
