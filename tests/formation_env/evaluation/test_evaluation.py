"""Evaluation: one line per seed, whatever the batch; honest intervals; and flights that agree with the table."""

import dataclasses
import itertools
from typing import Any

import numpy as np
import pandas as pd
import pytest
from env_helpers import restless

from formation_env import ENV_IDS, FormationEnv, Scenario, load_scenario
from formation_env.evaluation import rollout
from formation_env.evaluation.rollout import evaluate, record
from formation_env.evaluation.seeds import seeds
from formation_env.evaluation.statistics import summarise
from formation_env.kernel.metrics import METRICS, Metric
from formation_env.task.observation import SLICES
from formation_env.task.phases import Limits, Phase


class Damper:
    """Thrust against the velocity error, as much as a gain says; for one observation or a batch."""

    def __init__(self, gain: float = 0.5) -> None:
        self.gain = gain

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        """Actions (..., 3)."""
        return np.clip(-self.gain * observation[..., SLICES["error"]][..., 3:], -1, 1), state


class Counter:
    """A policy with a state: it counts the steps of each row's episode, and pushes harder and harder."""

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        """Actions (rows, 3) and the counts (rows,)."""
        assert deterministic
        counts = np.where(episode_start, 0, 0 if state is None else state + 1)
        return np.full((len(observation), 3), 1e-3) * counts[:, None], counts


def by_hand(policy: Any, scenario: Scenario, seed: int) -> dict[str, float]:
    """One line of the table, from a loop over the single environment."""
    env = FormationEnv(scenario)
    observation, _ = env.reset(seed=seed)
    while True:
        action, _ = policy.predict(observation)
        observation, _, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            return {"seed": seed, **info["episode_totals"]}


@pytest.mark.parametrize("scenario", [load_scenario("initialization"), restless(300.0)])
def test_one_line_per_seed_as_by_hand(scenario: Scenario) -> None:
    """Each line is what the single environment tells at the end of that seed's episode, in the seeds' order."""
    chosen = [7, 1_000_003, 0, 7]
    table = evaluate(Damper(), scenario, chosen)
    assert list(table.columns) == ["seed", *METRICS]
    expected = pd.DataFrame([by_hand(Damper(), scenario, seed) for seed in chosen])
    pd.testing.assert_frame_equal(table, expected, check_exact=True)


def test_lines_do_not_depend_on_the_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    """Seeds alone, in other company, in another order or in several batches: the same numbers."""
    scenario = restless(300.0)
    chosen = list(range(20, 60))
    table = evaluate(Damper(), scenario, chosen)
    assert table["steps"].nunique() > 2
    pd.testing.assert_frame_equal(evaluate(Damper(), scenario, chosen), table)
    backwards = evaluate(Damper(), scenario, chosen[::-1])[::-1].reset_index(drop=True)
    pd.testing.assert_frame_equal(backwards, table)
    pd.testing.assert_frame_equal(evaluate(Damper(), scenario, chosen[5:6]), table[5:6].reset_index(drop=True))
    monkeypatch.setattr(rollout, "MAX_ROWS", 7)
    pd.testing.assert_frame_equal(evaluate(Damper(), scenario, chosen), table)


def test_ids_names_and_scenarios_mean_the_same() -> None:
    """A registered id stands for its scenario."""
    expected = evaluate(Damper(), load_scenario("reconfiguration"), [3])
    for way in ("FormationReconfiguration-v0", "reconfiguration"):
        pd.testing.assert_frame_equal(evaluate(Damper(), way, [3]), expected)
    assert ENV_IDS["FormationReconfiguration-v0"] == "reconfiguration"


def test_a_policys_state_goes_along_and_starts_anew_with_each_episode() -> None:
    """The delta-v of a policy that pushes with k thousandths at step k, in rows that end at different times."""
    scenario = restless(300.0)
    table = evaluate(Counter(), scenario, range(12))
    assert table["steps"].nunique() > 2
    per_step = 0.002 * 1e-3 * np.sqrt(3) * scenario.dt_s
    expected = per_step * table["steps"] * (table["steps"] - 1) / 2
    np.testing.assert_allclose(table["delta_v_m_s"], expected, rtol=1e-5)  # actions are float32


def test_progress_tells_of_all_steps() -> None:
    """The sum is what a progress bar needs."""
    told: list[int] = []
    table = evaluate(Damper(), "initialization", [1, 2, 3], progress=told.append)
    assert sum(told) == table["steps"].sum()


def test_summary_has_mean_and_interval_of_each_metric() -> None:
    """Means are the columns' means; equal tables have equal summaries."""
    table = evaluate(Damper(), "initialization", range(12))
    summary = summarise(table)
    assert list(summary.index) == list(METRICS)
    np.testing.assert_allclose(summary["mean"], table[list(METRICS)].mean())
    assert (summary["low"] <= summary["mean"]).all()
    assert (summary["mean"] <= summary["high"]).all()
    assert summary.loc["steps"].tolist() == [145, 145, 145, 12]
    pd.testing.assert_frame_equal(summarise(table), summary)


@pytest.mark.parametrize(
    ("scenario", "seed"), [(load_scenario("initialization"), 3), (restless(300.0), 0), (load_scenario("mission"), 1)]
)
def test_a_recorded_flight_agrees_with_the_table(scenario: Scenario, seed: int) -> None:
    """The same seed flies the same episode; its instants add up to the table's line."""
    policy = Damper(0.1)
    line = evaluate(policy, scenario, [seed]).iloc[0]
    flight = record(policy, scenario, seed)
    assert len(flight) == line["steps"] + 1
    np.testing.assert_allclose(flight["time_s"], scenario.dt_s * np.arange(len(flight)))
    accel = flight[["ax_m_s2", "ay_m_s2", "az_m_s2"]].to_numpy()
    np.testing.assert_allclose(flight["delta_v_m_s"], scenario.dt_s * np.linalg.norm(accel, axis=1), rtol=1e-9)
    assert flight["delta_v_m_s"].sum() == pytest.approx(line["delta_v_m_s"])
    limit_m = scenario.limits.max_distance_m if line["steps"] < scenario.num_steps else 0.0
    assert max(flight["position_error_m"].iloc[-1], limit_m) == pytest.approx(line["position_error_final_m"])
    assert 1 - flight["measured"].mean() == pytest.approx(line["measurements_lost"])
    assert (flight.iloc[0][["ax_m_s2", "ay_m_s2", "az_m_s2"]] == 0).all()
    assert np.isfinite(flight.to_numpy(float)).all()


def test_a_recorded_flight_is_the_single_environments() -> None:
    """States, estimates and phases at every instant."""
    flight = record(Damper(), "mission", 5)
    env = FormationEnv("mission")
    observation, info = env.reset(seed=5)
    for k in range(len(flight)):
        states = flight.iloc[k, 1:7].to_numpy(float), flight.iloc[k, 7:13].to_numpy(float)
        np.testing.assert_array_equal(states, (info["true_state"], info["estimate"]))
        assert (flight["phase"][k], flight["measured"][k]) == (info["phase"], info["measured"])
        if k + 1 < len(flight):
            observation, _, _, _, info = env.step(Damper().predict(observation)[0])


def test_metrics_of_a_short_flight_by_hand() -> None:
    """Two steps of hold without any noise: every metric from the two known errors."""
    scenario = load_scenario("thesis_initialization")
    target = dataclasses.replace(scenario.phases[0].formation, y0_m=40.0)
    hold = Phase(formation=target, hold_orbits=2 / scenario.orbit.period_s)
    scenario = dataclasses.replace(scenario, phases=(hold,))
    line = evaluate(Damper(0.0), scenario, [0]).iloc[0]
    # At rest at the leader, where nothing moves: 40 m from the target, and more than the 30 m that are tolerated.
    expected = {
        "return": -0.01 * 40,
        "delta_v_m_s": 0,
        "position_error_mean_m": 40,
        "position_error_rms_m": 40,
        "position_error_max_m": 40,
        "position_error_arrival_m": 40,
        "position_error_final_m": 40,
        "in_tolerance": 0,
        "measurements_lost": 0,
        "steps": 2,
    }
    assert line[list(expected)].to_dict() == pytest.approx(expected, abs=1e-9)


def test_errors_after_an_early_end_are_those_at_the_limit() -> None:
    """A follower that enters the keep-out sphere 222 m off: no error metric is below another in kind.

    All count what is left of the plan as flown at the distance limit of 50 km, the final one too.
    """
    scenario = load_scenario("keeping")
    start = dataclasses.replace(scenario.start, initial_sigma_pos_m=100.0, initial_sigma_vel_m_s=0.5)
    limits = Limits(max_distance_m=50_000.0, keep_out_m=3850.0)
    table = evaluate(Damper(0.0), dataclasses.replace(scenario, start=start, limits=limits), range(30))
    early = table["steps"] < scenario.num_steps
    assert 0 < early.sum() < 30
    finals = table.loc[early, ["position_error_final_m", "position_error_max_m"]]
    assert ((finals >= 50_000) & (finals < 50_500)).all(axis=None)  # beyond the limit by a step at most
    assert (finals == 50_000).any(axis=None)
    assert (table.loc[early, "position_error_mean_m"] > 1000).all()
    assert (table.loc[~early, ["position_error_final_m", "position_error_max_m"]] < 50_000).all(axis=None)


@pytest.mark.parametrize("metric", METRICS.values(), ids=METRICS)
def test_a_metric_says_how_it_is_shown(metric: Metric) -> None:
    """Its name ends in the unit of its table, by the house's rule; only a share and a count have none."""
    suffixes = {"m": "_m", "m/s": "_m_s", "%": "", "% of hold": "", "": ""}
    if metric.name != "return":
        assert metric.name.endswith(suffixes[metric.unit])
    assert metric.heading
    assert (metric.factor == 100) == ("%" in metric.unit)
    assert (metric.factor < 0) == (metric.name == "return")
    assert (metric.better == "higher") == (metric.name in ("return", "in_tolerance"))


def test_seeds_of_different_splits_never_meet() -> None:
    """Nothing is judged on what it was tuned on; each split is as large as its range."""
    splits = [seeds(name, 1_000_000) for name in ("test", "validation", "tuning", "training")]
    for one, other in itertools.combinations(splits, 2):
        assert one.stop <= other.start or other.stop <= one.start
    assert seeds("test", 3) == splits[0][:3]
    for count in (0, 1_000_001):
        with pytest.raises(ValueError, match=f"count must be between 1 and 1000000, got {count}"):
            seeds("test", count)
