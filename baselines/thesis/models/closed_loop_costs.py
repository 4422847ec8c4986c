"""What the nonlinear world costs in closed loop: the same laws and filters, on linear and nonlinear truth."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final

import pandas as pd

from baselines.controllers.registry import make_policy
from baselines.experiments.policy_batch import SideBySide
from formation_env.dynamics import NONLINEAR
from formation_env.evaluation.rollout import evaluate
from formation_env.evaluation.statistics import bootstrap_interval
from formation_env.task.loading import config_folder, load_scenario
from formation_env.task.scenario import Scenario

LAWS: Final = ("lqr", "smc", "lqr_quasi_static")
LINEAR: Final = "linear"
OSCULATING: Final = "nonlinear, osculating reference"
MEAN: Final = "nonlinear, mean reference"
ELLIPTIC: Final = "nonlinear, Yamanaka-Ankersen believed"
CIRCULAR: Final = "nonlinear, HCW believed"
ECCENTRIC: Final = "keeping_eccentric"


@dataclass(frozen=True)
class Comparison:
    """A scenario that is flown in several worlds.

    Attributes:
        scenario: name of the shipped one.
        gains: whose gains the laws have in all worlds: a file in configs/baselines.
        laws: names of the policies.
    """

    scenario: str
    gains: str
    laws: tuple[str, ...] = LAWS

    def worlds(self) -> dict[str, Scenario]:
        """The scenario by world; filter and laws believe the same linear model in the first and the second."""
        return _elliptic(self.scenario) if self.scenario == ECCENTRIC else _circular(self.scenario)


COMPARISONS: Final = (
    Comparison("keeping", "keeping", (*LAWS, "zero")),
    Comparison("reconfiguration", "reconfiguration"),
    Comparison("initialization", "initialization"),
    Comparison("mission", "mission"),
    Comparison(ECCENTRIC, "keeping", (*LAWS, "zero")),
)


def _circular(name: str) -> dict[str, Scenario]:
    linear = _believing(load_scenario(name), "modified_hcw")
    true = replace(linear, dynamics=NONLINEAR)
    return {LINEAR: linear, OSCULATING: true, MEAN: replace(true, orbit=replace(true.orbit, mean_motion_from="mean"))}


def _elliptic(name: str) -> dict[str, Scenario]:
    linear = _believing(load_scenario(name), "yamanaka_ankersen")
    true = replace(linear, dynamics=NONLINEAR)
    return {LINEAR: linear, ELLIPTIC: true, CIRCULAR: replace(true, filter=replace(true.filter, dynamics="hcw"))}


def _believing(scenario: Scenario, dynamics: str) -> Scenario:
    """The scenario on a linear truth, with that model believed whatever the truth becomes."""
    return replace(scenario, dynamics=dynamics, filter=replace(scenario.filter, dynamics=dynamics))


@dataclass(frozen=True)
class Trial:
    """All laws of a comparison in one world, on the same seeds; a `Job` of `baselines.experiments.parallel`.

    Attributes:
        comparison: what is flown.
        world: where.
        seeds: one per episode.
    """

    comparison: Comparison
    world: str
    seeds: tuple[int, ...]

    @property
    def scenario(self) -> Scenario:
        """What is flown."""
        return self.comparison.worlds()[self.world]

    @property
    def cost(self) -> int:
        """How long it takes, in steps of one law; most of it is the design of the laws."""
        return 5_000 * len(self.comparison.laws)

    def run(self, progress: Callable[[int], Any] = lambda _: None) -> pd.DataFrame:
        """One line per episode: scenario, world, policy, seed, cost_m_s, delta_v_m_s, position_error_mean_m."""
        gains = config_folder("baselines") / f"{self.comparison.gains}.yaml"
        policies = [make_policy(law, self.scenario, gains) for law in self.comparison.laws]
        flown = evaluate(SideBySide(policies), self.scenario, [*self.seeds] * len(policies))
        flown.insert(0, "policy", [law for law in self.comparison.laws for _ in self.seeds])
        flown = flown.assign(scenario=self.comparison.scenario, world=self.world, cost_m_s=-flown["return"])
        progress(self.cost)
        return flown[["scenario", "world", "policy", "seed", "cost_m_s", "delta_v_m_s", "position_error_mean_m"]]


def summary(flown: pd.DataFrame) -> pd.DataFrame:
    """Costs by scenario, policy and world, and what they are more than in the linear world on the same seeds.

    Args:
        flown: lines of all trials.

    Returns:
        One line each: scenario, policy, world, cost_m_s, low, high, more_m_s, more_low, more_high, more_percent,
        delta_v_m_s, position_error_mean_m; the intervals are of 95 %.
    """
    lines = []
    for (scenario, policy), group in flown.groupby(["scenario", "policy"], sort=False):
        worlds = {name: part.set_index("seed") for name, part in group.groupby("world", sort=False)}
        for world, part in worlds.items():
            lines.append({"scenario": scenario, "policy": policy, "world": world, **_line(part, worlds[LINEAR])})
    return pd.DataFrame(lines)


def _line(part: pd.DataFrame, linear: pd.DataFrame) -> dict[str, float]:
    """Costs of a policy in a world, and beside those in the linear one; both tables by seed."""
    cost, before = part["cost_m_s"], linear["cost_m_s"]
    low, high = bootstrap_interval(cost.to_numpy(float))
    more = cost - before
    more_low, more_high = bootstrap_interval(more.to_numpy(float))
    return {
        "cost_m_s": cost.mean(),
        "low": low,
        "high": high,
        "more_m_s": more.mean(),
        "more_low": more_low,
        "more_high": more_high,
        "more_percent": 100 * more.mean() / before.mean(),
        "delta_v_m_s": part["delta_v_m_s"].mean(),
        "position_error_mean_m": part["position_error_mean_m"].mean(),
    }
