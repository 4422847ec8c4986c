"""The batched environment: many rows of a simulation."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from formation_env.envs import interface
from formation_env.kernel import tile as field
from formation_env.kernel.metrics import episode_metrics
from formation_env.kernel.simulation import Rows, Simulation
from formation_env.task.loading import load_scenario
from formation_env.task.scenario import Scenario

Observations = NDArray[np.float32]
Flags = NDArray[np.bool_]

MASK_OPTION: Final = "reset_mask"


class FormationVectorEnv(VectorEnv[Observations, NDArray[np.float32], NDArray[Any]]):
    """Many followers, each in an episode of its own; row i equals, bit for bit, a single environment with its seed.

    A row that ends is reset in the same step; its last observation and info are in `final_obs` and `final_info`.
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        scenario: str | Path | Scenario = "keeping",
        render_mode: str | None = None,
    ) -> None:
        """Make the environment.

        Args:
            num_envs: rows.
            scenario: a name, a path of a YAML file, or a Scenario.
            render_mode: None; render a single environment instead.

        Raises:
            ConfigError: the scenario is wrong.
            ValueError: no rows, or a render mode.
        """
        if num_envs < 1:
            raise ValueError(f"num_envs: must be at least 1, got {num_envs}")
        if render_mode is not None:
            raise ValueError(f"render_mode: the batched environment has none, got {render_mode!r}")
        self.scenario = load_scenario(scenario)
        self.num_envs = num_envs
        self.render_mode = None
        self.single_action_space = interface.action_space()
        self.single_observation_space = interface.observation_space()
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.simulation = Simulation(self.scenario, num_envs)
        self._info_scalars = interface.info_scalars(self.scenario)
        self._observations = self.simulation.new_observations()
        self._keyed = False

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin an episode in all rows, or in those of a mask.

        Args:
            seed: row i gets seed + i, or the i-th of a list; without a seed the rows' streams go on.
            options: `initial_state`: true LVLH states (6,) or (num_envs, 6) to start at, m and m/s; `reset_mask`:
                rows (num_envs,) to reset; the others stay as they are, return their last observation and have no info.

        Raises:
            ValueError: wrong options or number of seeds.
        """
        others = dict(options or {})
        rows = self._rows(others.pop(MASK_OPTION, None))
        starts = interface.read_start(others, self.simulation)
        self._seed(seed, rows)
        self.simulation.reset(rows, self._observations, None if starts is None else starts[rows])
        return self._observations.copy(), self._infos(rows if len(rows) < self.num_envs else slice(None))

    def _rows(self, mask: Any) -> NDArray[np.intp]:
        """Indices of the rows to reset: all, or those of a mask."""
        if mask is None:
            return np.arange(self.num_envs)
        mask = np.asarray(mask)
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_:
            raise ValueError(f"{MASK_OPTION}: must be bool ({self.num_envs},), got {mask.dtype} {mask.shape}")
        if not self._keyed and not mask.all():
            raise ValueError(f"{MASK_OPTION}: the first reset must be of all rows")
        return np.flatnonzero(mask)

    def _seed(self, seed: int | Sequence[int | None] | None, rows: NDArray[np.intp]) -> None:
        """Give streams to those of some rows that have a seed, or to all of them that have none yet."""
        if isinstance(seed, (int, np.integer)):
            seeds: Sequence[int | None] = range(int(seed), int(seed) + self.num_envs)
            self._np_random, self._np_random_seed = gymnasium.utils.seeding.np_random(int(seed))
        else:
            seeds = [None] * self.num_envs if seed is None else seed
        if len(seeds) != self.num_envs:
            raise ValueError(f"seed: a list must have {self.num_envs} elements, got {len(seeds)}")
        keyed = [row for row in rows.tolist() if seeds[row] is not None or not self._keyed]
        generators = [gymnasium.utils.seeding.np_random(seeds[row])[0] for row in keyed]
        for row, generator in zip(keyed, generators, strict=True):
            self.simulation.seed(row, generator)
        self._keyed = True

    def step(self, actions: Any) -> tuple[Observations, NDArray[np.float64], Flags, Flags, dict[str, Any]]:
        """Fly one step in all rows; rows that end begin their next episode.

        Args:
            actions: (num_envs, 3), in units of max_accel_m_s2, cut to [-1, 1].

        Raises:
            ValueError: the actions have a wrong shape or are not finite (it names the row); nothing has changed then.
            gymnasium.error.ResetNeeded: before the first reset.
        """
        actions = interface.check_actions(actions, self.num_envs)
        if not self._keyed:
            raise gymnasium.error.ResetNeeded("step: call reset first")
        simulation = self.simulation
        simulation.actions[:] = actions
        simulation.step(self._observations)
        rewards = simulation.result(field.REWARD).copy()
        terminations = simulation.result(field.TERMINATED) > 0.5
        truncations = simulation.result(field.TRUNCATED) > 0.5
        ended = np.flatnonzero(terminations | truncations)
        finals = self._begin_next(ended) if len(ended) else {}
        return self._observations.copy(), rewards, terminations, truncations, {**self._infos(), **finals}

    def _begin_next(self, ended: NDArray[np.intp]) -> dict[str, Any]:
        """Reset the rows that ended; what they ended with, in Gymnasium's form."""
        final_info = self._infos(ended)
        final_info |= self._spread(
            {interface.TOTALS: self._spread(episode_metrics(self.simulation, ended), ended)}, ended
        )
        final_obs = np.full(self.num_envs, None, dtype=object)
        for row in ended.tolist():
            final_obs[row] = self._observations[row].copy()
        self.simulation.reset(ended, self._observations)
        finals = self._spread({"final_info": final_info}, ended)
        return finals | {"final_obs": final_obs, "_final_obs": finals["_final_info"].copy()}

    def _infos(self, rows: Rows = slice(None)) -> dict[str, Any]:
        """Infos of some rows of the last step, in Gymnasium's form."""
        simulation = self.simulation
        infos: dict[str, Any] = {
            name: simulation.state(offset, size, rows) for name, (offset, size) in interface.INFO_STATES.items()
        }
        infos[interface.INFO_THRUST] = simulation.result_vector(field.THRUST, 3, rows)
        for name, (offset, kind) in self._info_scalars.items():
            infos[name] = simulation.result(offset, rows).astype(kind)
        return self._spread(infos, rows)

    def _spread(self, values: dict[str, Any], rows: Rows) -> dict[str, Any]:
        """Values of some rows as arrays of all, zero elsewhere, each with a mask of the rows that have it."""
        masks = np.zeros((len(values), self.num_envs), bool)
        masks[:, rows] = True
        spread: dict[str, Any] = {}
        for (name, value), mask in zip(values.items(), masks, strict=True):
            spread[name] = value
            if not isinstance(value, dict) and not isinstance(rows, slice):
                spread[name] = np.zeros((self.num_envs, *value.shape[1:]), value.dtype)
                spread[name][rows] = value
            spread[f"_{name}"] = mask
        return spread
