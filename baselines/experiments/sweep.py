"""Sweeps over scenario variations: the jobs, and their episodes as one table."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np
import pandas as pd

from baselines.experiments.estimates import ratio_of_means
from baselines.experiments.parallel import Progress
from baselines.experiments.policy_factories import PolicyFactory, cache_key
from baselines.experiments.variations import FRONT, VARIATIONS
from baselines.optimal import fuel_optimal
from formation_env.dynamics import NONLINEAR
from formation_env.evaluation.rollout import Policy, evaluate
from formation_env.evaluation.statistics import bootstrap_interval
from formation_env.numerics.arrays import Array
from formation_env.settings import ConfigError, faults_of
from formation_env.task.scenario import Scenario
from formation_env.task.schedule import build_schedule, column, columns

BOUND: Final = "bound"
"""Label of the perfect-information bound in the tables of the trade-off."""
KEYS: Final = ["env", "quantity", "value", "policy"]
METRICS: Final = ["cost_m_s", "delta_v_m_s", "position_error_mean_m"]
COLUMNS: Final = [*KEYS, "seed", *METRICS, "ended_early"]
ABOVE: Final = ["above_percent", "above_low_percent", "above_high_percent"]
"""Cost above the reference policy's on the same seeds, and its interval."""
SUMMARY_COLUMNS: Final = [
    *(*KEYS, "episodes", "ended_early", *METRICS, "cost_low_m_s", "cost_high_m_s", "reference"),
    *ABOVE,
]
REFERENCE: Final = "lqr"
"""The policy that others are compared with; the first policy where it does not fly."""


@dataclass(frozen=True)
class Point:
    """One varied environment, flown by all policies on the same seeds.

    Attributes:
        env: name of the environment.
        places: quantities and their values that make it; the scenario's own value of several is one point.
        flown: the scenario that is simulated.
        design: the scenario that policies are designed for.
        original: the scenario that was varied; policies have its settings throughout.
        policies: label -> factory.
        seeds: one per episode.
        bound_seeds: those for which the bound is solved.
    """

    env: str
    places: tuple[tuple[str, float], ...]
    flown: Scenario
    design: Scenario
    original: Scenario
    policies: Mapping[str, PolicyFactory]
    seeds: tuple[int, ...]
    bound_seeds: tuple[int, ...] = ()

    @property
    def cost(self) -> int:
        """Estimated duration, in steps of a batch."""
        return self.flown.num_steps * (len(self.policies) + len(self.bound_seeds))

    @property
    def key(self) -> Any:
        """Cache key (compared by repr); None, where a policy does not give its settings, disables caching."""
        settings = {name: cache_key(factory, self.original) for name, factory in self.policies.items()}
        place = (self.env, self.places, self.flown, self.design)
        return None if None in settings.values() else (*place, settings, self.seeds, self.bound_seeds)

    def run(self, progress: Progress) -> pd.DataFrame:
        """Fly it; progress is called with the cost of what was flown since the last call.

        Returns:
            One line per place, policy and seed, `COLUMNS`: the bound's on the front only, and none of a policy that
            there is not for the scenario.

        Raises:
            ConfigError: a policy cannot be made.
            RuntimeError: the bound's solver failed.
            ModuleNotFoundError: Clarabel is not installed, and the bound is wanted.
        """
        tables = []
        for name, factory in self.policies.items():
            policy = factory(self.original, self.design)
            if policy is not None:
                tables.append(self._fly(name, policy))
            progress(self.flown.num_steps)
        bounds = []
        for seed in self.bound_seeds:
            bounds.append(self._solve_bound(seed))
            progress(self.flown.num_steps)
        placed = [
            table.assign(env=self.env, quantity=quantity, value=value)
            for quantity, value in self.places
            for table in (*tables, *(bounds if quantity == FRONT else ()))
        ]
        table: pd.DataFrame = pd.concat(placed, ignore_index=True)[COLUMNS]
        return table

    def _fly(self, name: str, policy: Policy) -> pd.DataFrame:
        flown = evaluate(policy, self.flown, self.seeds)
        early = flown["steps"] < self.flown.num_steps
        return flown.assign(policy=name, cost_m_s=-flown["return"], ended_early=early)

    def _solve_bound(self, seed: int) -> pd.DataFrame:
        plan = fuel_optimal(self.flown, seed=seed)
        error_m = mean_hold_error_m(self.flown, plan.states)
        line = (BOUND, seed, plan.cost, plan.delta_v_m_s, error_m, False)
        return pd.DataFrame([line], columns=["policy", "seed", *METRICS, "ended_early"])


def mean_hold_error_m(scenario: Scenario, states: Array) -> float:
    """Mean position error of the hold, m, as the environment counts it.

    Args:
        scenario: what is flown.
        states: LVLH states (steps + 1, 6), m and m/s.
    """
    table = build_schedule(scenario)
    error_m, counts = np.linalg.norm(states[:, :3] - columns(table, "scored_position"), axis=1), column(table, "counts")
    return float(counts @ error_m / counts.sum())


def points(
    scenarios: Mapping[str, Scenario],
    policies: Mapping[str, PolicyFactory],
    seeds: Sequence[int],
    bound_episodes: int,
    coarse: bool = False,
) -> dict[str, Point]:
    """Jobs of a sweep, by name.

    Args:
        scenarios: label -> environment.
        policies: label -> factory.
        seeds: one per episode, the same everywhere.
        bound_episodes: how many of the seeds the bound is solved on, along the front; none where the truth is
            nonlinear.
        coarse: whether to take only a few values of each quantity.

    Raises:
        ConfigError: an error weight of 0, or a scenario that a variation does not fit.
    """
    jobs = {}
    for env, scenario in scenarios.items():
        if scenario.reward.error_weight == 0:
            raise ConfigError(f"sweep: {env}: reward.error_weight: must be > 0 for a trade-off, got 0")
        solved = tuple(seeds)[:bound_episodes] if scenario.dynamics != NONLINEAR else ()
        places: dict[tuple[Scenario, Scenario], list[tuple[str, float]]] = {}
        for quantity, value, flown, design in _varied(env, scenario, coarse):
            places.setdefault((flown, design), []).append((quantity, value))
        for (flown, design), own in places.items():
            jobs[f"{env} {own[0][0]} {own[0][1]:g}"] = Point(
                env=env,
                places=tuple(own),
                flown=flown,
                design=design,
                original=scenario,
                policies=policies,
                seeds=tuple(seeds),
                bound_seeds=solved if any(quantity == FRONT for quantity, _ in own) else (),
            )
    return jobs


def _varied(env: str, scenario: Scenario, coarse: bool) -> Iterator[tuple[str, float, Scenario, Scenario]]:
    for quantity, variation in VARIATIONS.items():
        for value in variation.few if coarse else variation.values:
            try:
                flown, design = variation.vary(scenario, value)
            except ConfigError as error:
                raise ConfigError(f"sweep: {env}: {quantity} = {value:g}: {faults_of(error)}") from None
            yield quantity, value, flown, design


@dataclass(frozen=True)
class Sweep:
    """Results of a sweep.

    Attributes:
        episodes: one line per episode: `COLUMNS`.
        summary: see `summarise`.
        faults: environment -> why it has no sweep.
    """

    episodes: pd.DataFrame
    summary: pd.DataFrame
    faults: dict[str, str]

    @classmethod
    def join(cls, tables: Sequence[pd.DataFrame], faults: dict[str, str]) -> Self:
        """The sweep from the tables of its points: by environment, quantity and value, the rest as it was flown."""
        episodes = pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=COLUMNS)
        places = {name: place for place, name in enumerate((*episodes["env"].unique(), *VARIATIONS))}
        for key in ("value", "quantity", "env"):
            sort = None if key == "value" else lambda names: names.map(places)
            episodes = episodes.sort_values(key, key=sort, kind="stable", ignore_index=True)
        return cls(episodes, summarise(episodes), faults)

    def of(self, env: str) -> Self:
        """The part of one environment."""
        episodes, summary = (table[table["env"] == env] for table in (self.episodes, self.summary))
        return type(self)(episodes, summary, {name: fault for name, fault in self.faults.items() if name == env})

    def as_data(self) -> dict[str, Any]:
        """Means, intervals and varied quantities as plain data."""
        return {
            "quantities": {
                name: {"label": VARIATIONS[str(name)].label, "values": values.unique().tolist()}
                for name, values in self.summary.groupby("quantity", sort=False)["value"]
            },
            "summary": self.summary.to_dict(orient="records"),
            "left_out": self.faults,
        }


def summarise(episodes: pd.DataFrame) -> pd.DataFrame:
    """Means of each point and policy, the cost's with its 95 % interval, and the paired difference to a reference.

    Returns:
        One line each: `KEYS`, episodes, ended_early (how many), the means of `METRICS`, low and high of the cost, the
        name of the reference policy, and by how many per cent the mean cost is above the reference's on the same seeds,
        with its interval; NaN for the bound, which has fewer seeds.
    """
    lines = []
    for _, point in episodes.groupby(KEYS[:-1], sort=False):
        costs = {str(name): own["cost_m_s"].to_numpy(float) for name, own in point.groupby("policy", sort=False)}
        reference = REFERENCE if REFERENCE in costs else next(iter(costs))
        for key, own in point.groupby(KEYS, sort=False):
            means = [float(own[metric].mean()) for metric in METRICS]
            interval = bootstrap_interval(own["cost_m_s"].to_numpy(float))
            above = _above_percent(costs[str(key[-1])], costs[reference])
            lines.append((*key, len(own), int(own["ended_early"].sum()), *means, *interval, reference, *above))
    return pd.DataFrame(lines, columns=SUMMARY_COLUMNS)


def _above_percent(costs: Array, reference: Array) -> tuple[float, float, float]:
    """By how many per cent a mean cost is above the reference's, paired by seed, with its interval."""
    if len(costs) != len(reference) or not reference.mean() > 0:
        return np.nan, np.nan, np.nan
    mean, low, high = (100 * (value - 1) for value in ratio_of_means(costs, reference))
    return mean, low, high
