"""The batched environment: many rows of a simulation."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from formation_env.envs import info_keys, interface
from formation_env.envs.batch_arguments import (
    MASK_OPTION,
    check_arguments,
    check_ready,
    read_autoreset_mode,
    read_mask,
)
from formation_env.kernel.metrics import METRICS, SAFETY_METRICS, episode_metrics
from formation_env.kernel.reused_arrays import ReusedZeros
from formation_env.kernel.simulation import Simulation
from formation_env.kernel.threads import check_num_threads
from formation_env.task.loading import load_scenario
from formation_env.task.scenario import Scenario

Observations = NDArray[np.float32]
Flags = NDArray[np.bool_]

_NO_ROWS: Final = np.empty(0, np.intp)


class FormationVectorEnv(VectorEnv[Observations, NDArray[np.float32], NDArray[Any]]):
    """Many followers, each in an episode of its own; row i equals, bit for bit, a single environment with its seed.

    A row that ends is reset as `autoreset_mode` says, in Gymnasium's terms:
        SAME_STEP: in the same step; its last observation and info are in `final_obs` and `final_info`.
        NEXT_STEP: by the next call of `step`, which ignores the row's action and gives it reward 0.
        DISABLED: by the user, with `reset(options={"reset_mask": ...})`, before the next step.
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012

    @interface.known_arguments
    def __init__(
        self,
        num_envs: int = 1,
        scenario: str | Path | Scenario = "keeping",
        render_mode: str | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
        max_episode_steps: int | None = None,
        analysis: bool = False,
        num_threads: int | None = None,
    ) -> None:
        """Make the environment.

        Args:
            num_envs: number of rows.
            scenario: a name, a path of a YAML file, or a Scenario.
            render_mode: None; render a single environment instead.
            autoreset_mode: when rows that ended are reset; an `AutoresetMode` or its value.
            max_episode_steps: truncate episodes after this many steps, if the plan is longer, as Gymnasium's
                `TimeLimit` does for a single environment; such episodes have no `episode_totals`.
            analysis: as of `FormationEnv`.
            num_threads: threads that share a step, with the same results bit for bit; None: a number that suits the
                rows and the CPUs.

        Raises:
            ConfigError: the scenario is wrong.
            ValueError: no rows, a render mode, an unknown autoreset mode, no steps or no threads.
        """
        check_arguments(num_envs, render_mode, max_episode_steps)
        self.autoreset_mode = read_autoreset_mode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.scenario = interface.one_follower(load_scenario(scenario), "FormationSwarmVectorEnv")
        self.num_envs = num_envs
        self.max_episode_steps = min(max_episode_steps or self.scenario.num_steps, self.scenario.num_steps)
        self._is_cut = self.max_episode_steps < self.scenario.num_steps
        self._spec: EnvSpec | None = None
        self.render_mode = None
        self.single_action_space = interface.action_space()
        self.single_observation_space = interface.observation_space()
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.simulation = Simulation(self.scenario, num_envs, analysis, check_num_threads(num_threads, num_envs))
        self._metrics = (*METRICS, *SAFETY_METRICS) if self.simulation.guarded else (*METRICS,)
        self._totals_blocks = ReusedZeros([((len(self._metrics), num_envs), float)])
        self._info_keys = info_keys.keys_of(self.scenario, self.simulation.guarded, analysis)
        self._every_row = np.ones(num_envs, bool)
        self._keyed = False
        self._waiting = np.empty(0, np.intp)  # rows that ended and are not reset yet

    @property
    def spec(self) -> EnvSpec | None:
        """Gymnasium's spec of the environment; `max_episode_steps` is the length of an episode."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = interface.with_length(spec, self.max_episode_steps)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | NDArray[np.integer] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin an episode in all rows, or in those of a mask.

        Args:
            seed: row i gets seed + i, or the i-th of a list or array; without a seed the rows' streams continue.
            options: `initial_state`: true LVLH states (6,) or (num_envs, 6) to start at, m and m/s; `reset_mask`:
                rows (num_envs,) to reset; the others stay as they are, return their last observation and have no info.

        Raises:
            ValueError: wrong options or number of seeds.
        """
        others = dict(options or {})
        rows = read_mask(others.pop(MASK_OPTION, None), self.num_envs, self._keyed)
        starts = interface.read_start(others, self.simulation)
        seeds = interface.check_seeds(seed, self.num_envs)
        if isinstance(seeds, range):
            self._np_random, self._np_random_seed = gymnasium.utils.seeding.np_random(seeds.start)
        self._seed(seeds, rows)
        observations = self.simulation.new_observations()
        if len(rows) < self.num_envs:
            self.simulation.look(observations)
        self.simulation.new_results(rows)
        self.simulation.reset(rows, observations, None if starts is None else starts[rows])
        self._waiting = np.setdiff1d(self._waiting, rows)
        return observations, self._infos(None if len(rows) == self.num_envs else rows)

    def _seed(self, seeds: Sequence[int | None], rows: NDArray[np.intp]) -> None:
        """Give streams to those of some rows that have a seed, or to all of them that have none yet."""
        keyed = [row for row in rows.tolist() if seeds[row] is not None or not self._keyed]
        for row in keyed:
            self.simulation.seed(row, np.random.default_rng(seeds[row]))  # as Gymnasium seeds a single one
        self._keyed = True

    def step(self, actions: Any) -> tuple[Observations, NDArray[np.float64], Flags, Flags, dict[str, Any]]:
        """Fly one step in all rows.

        Args:
            actions: (num_envs, 3), in units of max_accel_m_s2, clipped to [-1, 1].

        Raises:
            ValueError: the actions have a wrong shape or are not finite (it names the row); nothing has changed then.
            gymnasium.error.ResetNeeded: before the first reset, or a row has ended and autoreset is disabled.
        """
        actions = interface.check_actions(actions, self.num_envs)
        check_ready(self._keyed, self._waiting if self.autoreset_mode is AutoresetMode.DISABLED else _NO_ROWS)
        simulation = self.simulation
        simulation.actions[:] = actions
        observations = simulation.new_observations()
        num_ended = simulation.step(observations)
        if len(self._waiting):  # they begin in this step; what they flew is overwritten
            simulation.reset(self._waiting, observations)
            simulation.forget_ends(self._waiting)
        rewards, terminations, truncations = map(simulation.results.__getitem__, ("reward", "terminated", "truncated"))
        ended = complete = _NO_ROWS
        if num_ended:
            ended = complete = np.flatnonzero(terminations | truncations)
        if self._is_cut:
            truncations |= simulation.read("step") >= self.max_episode_steps
            ended = np.flatnonzero(terminations | truncations)
        finals = self._end(observations, ended, complete) if len(ended) else {}
        if self.autoreset_mode is not AutoresetMode.SAME_STEP:
            self._waiting = ended
        shown = self._infos()
        shown.update(finals)
        return observations, rewards, terminations, truncations, shown

    def _end(self, observations: Observations, ended: NDArray[np.intp], complete: NDArray[np.intp]) -> dict[str, Any]:
        """Infos of rows that ended, those of a complete plan with its totals; with SAME_STEP they are reset."""
        totals = self._totals(complete) if len(complete) else {}
        return (
            self._begin_next(observations, ended, totals) if self.autoreset_mode is AutoresetMode.SAME_STEP else totals
        )

    def _totals(self, rows: NDArray[np.intp]) -> dict[str, Any]:
        """Totals of rows that flew to their episode's end, in Gymnasium's form."""
        (columns,) = self._totals_blocks.take_for(rows)
        columns[:, rows] = list(episode_metrics(self.simulation, rows).values())
        totals = info_keys.with_mask(dict(zip(self._metrics, columns, strict=True)), self._mask(rows))
        return {info_keys.TOTALS: totals, f"_{info_keys.TOTALS}": self._mask(rows)}

    def _begin_next(
        self, observations: Observations, ended: NDArray[np.intp], totals: dict[str, Any]
    ) -> dict[str, Any]:
        """Reset the rows that ended; their last observations and infos, in Gymnasium's form."""
        final_info = self._infos(ended) | totals
        final_obs = np.empty(self.num_envs, object)  # None everywhere
        for row, observation in zip(ended.tolist(), observations[ended], strict=True):
            final_obs[row] = observation
        self.simulation.reset(ended, observations)
        masks = {"_final_info": self._mask(ended), "_final_obs": self._mask(ended)}
        return {"final_info": final_info, "final_obs": final_obs, **masks}

    def _infos(self, rows: NDArray[np.intp] | None = None) -> dict[str, Any]:
        """Infos of the last step or reset in Gymnasium's form, of all rows or zero but for some."""
        results = self.simulation.results if rows is None else self.simulation.last_results(rows)
        mask = self._every_row.copy() if rows is None else self._mask(rows)
        shown = info_keys.batched(self._info_keys, results, mask)
        if not self.simulation.guarded:
            shown |= info_keys.with_mask({info_keys.COST: np.zeros(self.num_envs)}, mask)
        return shown

    def _mask(self, rows: NDArray[np.intp]) -> Flags:
        """Which rows are among some (num_envs,)."""
        mask = np.zeros(self.num_envs, bool)
        mask[rows] = True
        return mask
