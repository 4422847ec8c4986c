"""The report's table of learned policies: its numbers are those of the flights and of the cards."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from agents.policy.library import Card, Interval, Trained
from agents.results.report_table import COLUMNS, learned_table
from baselines.experiments.comparison import Flown
from baselines.experiments.estimates import ratio_of_means
from baselines.experiments.statistics import Results, analyse
from formation_env import Scenario, load_scenario
from formation_env.kernel.metrics import METRICS

KEEPING, BAD = load_scenario("keeping"), load_scenario("bad_communication")
SEEDS = 30
RNG = np.random.default_rng(0)
LEVEL = RNG.uniform(0.5, 1.5, SEEDS)
"""What a seed costs anybody; the policies differ by far less."""
COSTS = {
    "ppo": LEVEL - 0.05 + RNG.normal(0, 0.02, SEEDS),
    "lqr": LEVEL,
    "smc": LEVEL + 0.3,
    "lqr_nominal": LEVEL - 0.01,
    "mpc": (LEVEL - 0.1)[:4],
}


def flown(scenario: Scenario, label: str, costs: dict[str, np.ndarray]) -> Results:
    """Results of flights that cost so much, and take 20 microseconds an action, or 10 ms."""
    tables = {
        name: pd.DataFrame(dict.fromkeys(METRICS, 1.0) | {"seed": range(len(each)), "return": -each})
        for name, each in costs.items()
    }
    times = {name: pd.DataFrame({"action_time_us": [1e4 if name == "mpc" else 20.0]}) for name in costs}
    (results,) = analyse([Flown(label, scenario, tables, 0, times, {})], {label: 0.8 * LEVEL})
    return results


def run_of(seed: int, pretraining_s: float | None, wall_time_s: float) -> Trained:
    cost = Interval(mean=0.9, low=0.8, high=1.0)
    return Trained(
        seed=seed,
        steps=2_000_000,
        pretraining_s=pretraining_s,
        wall_time_s=wall_time_s,
        validation_cost_m_s=0.9,
        test_cost_m_s=cost,
        saved_m_s=Interval(mean=0.05, low=0.04, high=0.06),
    )


CARD = Card(
    algorithm="ppo",
    env="FormationKeeping-v0",
    observation_size=38,
    sha256="",
    test={},
    test_episodes=100,
    first_test_costs_m_s=(),
    cost_over_runs_m_s=Interval(mean=0.91, low=0.9, high=0.92),
    runs=(run_of(0, 60.0, 30.0), run_of(1, 120.0, 60.0)),
    training={},
    scenario=KEEPING,
)


def cells(results: Results, card: Card) -> dict[str, str]:
    """The one line of a table, by its headings."""
    (row,) = learned_table([results], {"ppo": [card]}).texts()
    return dict(zip(COLUMNS, row, strict=True))


def ratio_of(cell: str) -> tuple[float, float, float]:
    """Mean, low and high of "1.0 [0.9, 1.1] (name)"."""
    mean, low, high = cell.split(" (")[0].replace("[", "").replace("]", "").replace(",", "").split()
    return float(mean), float(low), float(high)


def test_ratios_are_paired_by_seed() -> None:
    """The interval is that of scipy's paired bootstrap of the ratio, and far narrower than the costs' own.

    Ours is of the linearised ratio: its ends may differ by the bootstrap's noise and by 1 / seeds: a tenth.
    """
    text = cells(flown(KEEPING, "keeping", COSTS), CARD)["over best LQR or SMC"]
    assert text.endswith(" (lqr)")
    mean, low, high = ratio_of(text)
    assert mean == pytest.approx(COSTS["ppo"].mean() / LEVEL.mean(), abs=6e-4)  # three decimals are shown

    def ratio(ours: np.ndarray, theirs: np.ndarray, axis: int) -> np.ndarray:
        return ours.mean(axis=axis) / theirs.mean(axis=axis)

    rng = np.random.default_rng(1)
    found = stats.bootstrap((COSTS["ppo"], LEVEL), ratio, paired=True, vectorized=True, rng=rng).confidence_interval
    width = found.high - found.low
    np.testing.assert_allclose((low, high), found, atol=0.1 * width)
    assert width < 0.1 * 4 * LEVEL.std() / np.sqrt(SEEDS)


def test_the_best_of_all_may_have_flown_fewer_seeds() -> None:
    """It is held against the policy on these alone."""
    text = cells(flown(KEEPING, "keeping", COSTS), CARD)["over best classical"]
    assert text.endswith(" (mpc, 4 of 30 seeds)")
    assert ratio_of(text)[0] == pytest.approx(COSTS["ppo"][:4].mean() / COSTS["mpc"].mean(), abs=6e-3)


def test_a_policy_over_itself_is_one() -> None:
    """Nothing scatters then, and the bootstrap is not asked."""
    assert ratio_of_means(LEVEL, LEVEL) == (1.0, 1.0, 1.0)
    assert ratio_of_means(LEVEL[:1], LEVEL[:1] / 2) == (2.0, 2.0, 2.0)


def test_the_card_gives_what_training_took() -> None:
    """Means over the runs; unknown times of pretraining are not taken for none, one run has no interval over runs."""
    results = flown(KEEPING, "keeping", COSTS)
    found = cells(results, CARD)
    assert (found["training seeds"], found["steps per run"]) == ("2", "2,000,000")
    assert found["mean over training seeds, m/s"] == "0.910 [0.900, 0.920]"
    assert (found["pretraining per run, min"], found["RL per run, min"]) == ("1.5", "0.8")
    assert (found["time per action, µs"], found["time per action of mpc, µs"]) == ("20", "10,000")
    alone = replace(CARD, runs=(run_of(0, None, 30.0),), cost_over_runs_m_s=None)
    found = cells(results, alone)
    assert (found["pretraining per run, min"], found["RL per run, min"]) == ("–", "0.5")
    assert found["mean over training seeds, m/s"] == "–"


def test_a_line_for_each_environment_that_was_trained_on() -> None:
    """A scenario that is no registered id has its own; what was not flown has none."""
    results = [flown(KEEPING, "FormationKeeping-v0", COSTS), flown(BAD, "bad_communication", COSTS)]
    other = replace(CARD, env="bad_communication", scenario=BAD)
    table = learned_table(results, {"ppo": [CARD, other]})
    assert [row[:2] for row in table.rows] == [("FormationKeeping-v0", "ppo"), ("bad_communication", "ppo")]
    assert learned_table(results[:1], {"ppo": [other]}).rows == ()
    text = table.markdown().splitlines()
    assert [line.count("|") for line in text[:4]] == [len(COLUMNS) + 1] * 4
    assert text[2].startswith("| FormationKeeping-v0 | ppo | ")


def test_nothing_to_compare_with_is_a_dash() -> None:
    """Without classical policies and without a bound."""
    alone = {"ppo": COSTS["ppo"]}
    results = replace(flown(KEEPING, "keeping", alone), cost_ratios={}, cost_ratios_flown={})
    found = cells(results, CARD)
    names = ("cost over bound", "over best LQR or SMC", "over best classical", "time per action of mpc, µs")
    assert [found[name] for name in names] == ["–"] * 4
