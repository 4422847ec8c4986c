"""Flights of several policies side by side in one batch."""

from collections.abc import Callable, Sequence
from typing import Any, Final

from baselines.design.guidance import GuidanceName
from baselines.experiments.policy_batch import SideBySide
from baselines.thesis.flight_recorder import FlightRecorder, recorded_steps
from baselines.thesis.measurement_probe import MeasurementProbe, with_final_infos
from baselines.thesis.recorded_flights import Flights
from formation_env.envs import interface
from formation_env.envs.vector import FormationVectorEnv
from formation_env.evaluation.rollout import Policy
from formation_env.numerics.arrays import Array
from formation_env.task.scenario import Scenario

FEW: Final = 1
"""Default number of seeds of each policy whose full states are recorded."""


def fly_laws(
    policies: Sequence[Policy],
    scenario: Scenario,
    seeds: Sequence[int],
    guide: GuidanceName = "automatic",
    every: int = 1,
    few: int = FEW,
    measured: bool = False,
    start: Array | None = None,
    progress: Callable[[int], Any] = lambda steps: None,
) -> Flights:
    """Fly all policies on all seeds in one batch.

    Args:
        policies: policies that fly.
        scenario: scenario flown.
        seeds: one per episode, the same for all policies.
        guide: desired path that errors are measured from, see `baselines.design.guidance`.
        every: steps between recorded instants; sums and maxima are exact all the same.
        few: seeds of each policy, the first ones, whose states are recorded.
        measured: whether their measurements are recorded.
        start: true LVLH state (6,) to start at in place of the scenario's start and its spread, m and m/s.
        progress: called with the number of steps completed since the last call, over all rows.
    """
    env, batch = FormationVectorEnv(len(policies) * len(seeds), scenario), SideBySide(policies)
    options = None if start is None else {interface.START_OPTION: start}
    observations, infos = env.reset(seed=[*seeds] * len(policies), options=options)
    log = FlightRecorder(scenario, (len(policies), len(seeds)), recorded_steps(scenario, every), few, guide)
    probe = MeasurementProbe(scenario, len(policies), seeds[:few], options) if measured else None
    log.add(infos, measurement=probe.seen if probe else None)
    for _ in range(scenario.num_steps):
        actions = batch.predict(observations)[0]
        observations, _, terminations, truncations, infos = env.step(actions)
        ended = terminations | truncations
        infos = with_final_infos(infos) if ended.any() else infos
        if probe:
            probe.step(actions)
        log.add(infos, ended, probe.seen if probe else None)
        progress(env.num_envs)
    return log.flights(tuple(int(seed) for seed in seeds))
