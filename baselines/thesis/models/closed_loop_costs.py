"""Closed-loop cost of the nonlinear truth: the same laws and filters on linear and nonlinear truth."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final

import pandas as pd

from baselines.controllers.registry import make_policy
from baselines.experiments.policy_batch import PolicyBatch
from formation_env.dynamics import NONLINEAR
from formation_env.evaluation.rollout import evaluate
from formation_env.evaluation.statistics import bootstrap_interval
from formation_env.task.loading import config_folder, load_scenario
from formation_env.task.scenario import Scenario

LAWS: Final = ("lqr", "smc", "lqr_quasi_static")
LINEAR: Final = "linear"
OSCULATING: Final = "nonlinear, osculating mean motion"
MEAN: Final = "nonlinear, mean radius"
ELLIPTIC: Final = "nonlinear, filter model Yamanaka-Ankersen"
CIRCULAR: Final = "nonlinear, filter model HCW"
ECCENTRIC: Final = "keeping_eccentric"


@dataclass(frozen=True)
class ClosedLoopComparison:
    """A scenario flown on several truths.

    Attributes:
        scenario: name of the shipped one.
        settings: name of the file in configs/baselines with the laws' settings on all truths.
        laws: names of the policies.
    """

    scenario: str
    settings: str
    laws: tuple[str, ...] = LAWS

    def truths(self) -> dict[str, Scenario]:
        """Scenario by truth; the filter model is the same in the first and the second."""
        return _elliptic(self.scenario) if self.scenario == ECCENTRIC else _circular(self.scenario)


COMPARISONS: Final = (
    ClosedLoopComparison("keeping", "keeping", (*LAWS, "zero")),
    ClosedLoopComparison("reconfiguration", "reconfiguration"),
    ClosedLoopComparison("initialization", "initialization"),
    ClosedLoopComparison("mission", "mission"),
    ClosedLoopComparison(ECCENTRIC, "keeping", (*LAWS, "zero")),
)


def _circular(name: str) -> dict[str, Scenario]:
    linear = _with_filter_model(load_scenario(name), "modified_hcw")
    true = replace(linear, dynamics=NONLINEAR)
    return {LINEAR: linear, OSCULATING: true, MEAN: replace(true, orbit=replace(true.orbit, mean_motion_from="mean"))}


def _elliptic(name: str) -> dict[str, Scenario]:
    linear = _with_filter_model(load_scenario(name), "yamanaka_ankersen")
    true = replace(linear, dynamics=NONLINEAR)
    return {LINEAR: linear, ELLIPTIC: true, CIRCULAR: replace(true, filter=replace(true.filter, dynamics="hcw"))}


def _with_filter_model(scenario: Scenario, dynamics: str) -> Scenario:
    """Scenario on a linear truth that is also the filter model, whatever the truth is changed to."""
    return replace(scenario, dynamics=dynamics, filter=replace(scenario.filter, dynamics=dynamics))


@dataclass(frozen=True)
class Trial:
    """Job that flies all laws of a comparison on one truth, on the same seeds.

    Attributes:
        comparison: scenario and laws.
        truth: name of the truth.
        seeds: one per episode.
    """

    comparison: ClosedLoopComparison
    truth: str
    seeds: tuple[int, ...]

    @property
    def scenario(self) -> Scenario:
        """Scenario flown."""
        return self.comparison.truths()[self.truth]

    @property
    def cost(self) -> int:
        """Duration in steps of one law; most of it is the design of the laws."""
        return 5_000 * len(self.comparison.laws)

    def run(self, progress: Callable[[int], Any] = lambda _: None) -> pd.DataFrame:
        """Lines by episode: scenario, truth, policy, seed, cost_m_s, delta_v_m_s, position_error_mean_m."""
        settings = config_folder("baselines") / f"{self.comparison.settings}.yaml"
        policies = [make_policy(law, self.scenario, settings) for law in self.comparison.laws]
        flown = evaluate(PolicyBatch(policies), self.scenario, [*self.seeds] * len(policies))
        flown.insert(0, "policy", [law for law in self.comparison.laws for _ in self.seeds])
        flown = flown.assign(scenario=self.comparison.scenario, truth=self.truth, cost_m_s=-flown["return"])
        progress(self.cost)
        return flown[["scenario", "truth", "policy", "seed", "cost_m_s", "delta_v_m_s", "position_error_mean_m"]]


def summary(flown: pd.DataFrame) -> pd.DataFrame:
    """Costs by scenario, policy and truth, and their paired increase over the linear truth.

    Args:
        flown: lines of all trials.

    Returns:
        One line each: scenario, policy, truth, cost_m_s, low, high, more_m_s, more_low, more_high, more_percent,
        delta_v_m_s, position_error_mean_m; the intervals are of 95 %.
    """
    lines = []
    for (scenario, policy), group in flown.groupby(["scenario", "policy"], sort=False):
        truths = {name: part.set_index("seed") for name, part in group.groupby("truth", sort=False)}
        for truth, part in truths.items():
            lines.append({"scenario": scenario, "policy": policy, "truth": truth, **_line(part, truths[LINEAR])})
    return pd.DataFrame(lines)


def _line(part: pd.DataFrame, linear: pd.DataFrame) -> dict[str, float]:
    """Costs of a policy on a truth and their increase over the linear one; both tables by seed."""
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
