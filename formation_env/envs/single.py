"""The single environment: one row of a simulation."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from formation_env.envs import info_keys, interface
from formation_env.kernel.metrics import episode_metrics
from formation_env.kernel.simulation import Simulation
from formation_env.kernel.tile import INTEGERS, RESULTS
from formation_env.rendering.modes import FRAMES_PER_S, RENDER_MODES
from formation_env.task.loading import load_scenario
from formation_env.task.scenario import Scenario

Observation = NDArray[np.float32]

_ONLY_ROW = np.zeros(1, np.intp)
# Places of the results, looked up once.
_TRUE_STATE = slice(RESULTS.true_state, RESULTS.true_state + 6)
_ESTIMATE = slice(RESULTS.estimate, RESULTS.estimate + 6)
_THRUST = slice(RESULTS.thrust, RESULTS.thrust + 3)
_NUMBERS = slice(RESULTS.position_error, RESULTS.reward + 1)
_PHASE, _VARIANT = INTEGERS


class FormationEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """A follower that flies a scenario around its leader.

    Observation: see `formation_env.task.observation`. Action: LVLH acceleration in units of the scenario's
    max_accel_m_s2. Reward: see `formation_env.task.scenario.Reward`.

    Truncated at the end of the plan; terminated beyond a limit.
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": FRAMES_PER_S}  # noqa: RUF012

    @interface.known_arguments
    def __init__(
        self, scenario: str | Path | Scenario = "keeping", render_mode: str | None = None, analysis: bool = False
    ) -> None:
        """Make the environment.

        Args:
            scenario: a name, a path of a YAML file, or a Scenario.
            render_mode: None, `rgb_array` or `human`.
            analysis: whether infos also hold the simulated `measurement` (whether or not it was received, which
                `measured` tells), its `innovation` (measurement minus prediction), `process_noise_m_s2` and
                `thrust_noise`, see `kernel.tile.Noises`.

        Raises:
            ConfigError: the scenario is wrong.
            ValueError: unknown render mode.
        """
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode: must be one of {self.metadata['render_modes']}, got {render_mode!r}")
        self.scenario = interface.one_follower(load_scenario(scenario), "FormationSwarmEnv")
        self._spec: EnvSpec | None = None
        self.render_mode = render_mode
        self.action_space = interface.action_space()
        self.observation_space = interface.observation_space()
        self.simulation = Simulation(self.scenario, 1, with_noises=analysis)
        self._observations = self.simulation.new_observations()
        self._arguments = self.simulation.arguments(self._observations)
        with_analysis = info_keys.keys_of(self.scenario, self.simulation.guarded, analysis)
        self._info_keys_of_analysis = with_analysis[
            len(info_keys.keys_of(self.scenario, self.simulation.guarded, False)) :
        ]
        self._varied = self.scenario.domain_randomization is not None
        self._keyed = False
        self._renderer: Any = None
        self._trail: Any = None
        if render_mode is not None:
            from formation_env.rendering.moment import Trail

            self._trail = Trail(self.scenario)

    @property
    def spec(self) -> EnvSpec | None:
        """Gymnasium's spec of the environment; `max_episode_steps` is the length of the scenario's plan.

        No `TimeLimit` enforces it, since the environment itself truncates there.
        """
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = interface.with_length(spec, self.scenario.num_steps)

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: seed of a new random stream; without it the present stream continues.
            options: `initial_state`: the true LVLH state (6,) to start at, m and m/s.

        Raises:
            ValueError: wrong options or seed.
        """
        seed = interface.check_seed(seed)
        starts = interface.read_start(options, self.simulation)
        super().reset(seed=seed)
        if seed is not None or not self._keyed:
            self.simulation.seed(0, self.np_random)
            self._keyed = True
        self.simulation.reset(_ONLY_ROW, self._observations, starts)
        self.simulation.forget_ends(_ONLY_ROW)
        if self._renderer is not None:
            self._renderer.restart()
        if self._trail is not None:
            self._trail.clear()
            self._show()
        info, _, _, _ = self._read_results()
        return self._observations[0].copy(), info

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Fly one step.

        Args:
            action: (3,), in units of max_accel_m_s2, clipped to [-1, 1].

        Raises:
            ValueError: the action has a wrong shape or is not finite; nothing has changed then.
            gymnasium.error.ResetNeeded: before the first reset.
        """
        action = interface.check_action(action)
        if not self._keyed:
            raise gymnasium.error.ResetNeeded("step: call reset first")
        simulation = self.simulation
        simulation.actions[0] = action
        simulation.fly(self._arguments)
        simulation.count_safety()
        info, reward, terminated, truncated = self._read_results()
        if terminated or truncated:
            info[info_keys.TOTALS] = {name: float(value[0]) for name, value in episode_metrics(simulation).items()}
        if self._trail is not None:
            self._show()
        return self._observations[0].copy(), reward, terminated, truncated, info

    def _read_results(self) -> tuple[dict[str, Any], float, bool, bool]:
        """Info, reward and ends of the last step or reset; the info's vectors are views of a copy of its results."""
        block, flags, integers, safety, _ = self.simulation.results.blocks
        values = block.ravel().copy()
        error_m, delta_v, error_cost, exit_cost, nis, reward = values[_NUMBERS].tolist()
        (measured,), (terminated,), (truncated,) = flags.tolist()
        info: dict[str, Any] = {
            "true_state": values[_TRUE_STATE],
            "estimate": values[_ESTIMATE],
            "accel_m_s2": values[_THRUST],
            "position_error_m": error_m,
            "delta_v_m_s": delta_v,
            "error_cost_m_s": error_cost,
            "exit_cost_m_s": exit_cost,
            "nis": nis,
            "cost": 0.0,
            "measured": measured,
            "phase": integers.item(_PHASE),
        }
        if self._varied:
            info["variant"] = integers.item(_VARIANT)
        if self.simulation.guarded:
            (info["cost"],), (info["least_distance_m"],) = safety.tolist()
        for name, _, place_block, place in self._info_keys_of_analysis:
            info[name] = self.simulation.results.blocks[place_block][place, 0].copy()
        return info, reward, terminated, truncated

    def _show(self) -> None:
        """Record where the follower is now; in mode `human` draw it."""
        self._trail.record(self.simulation)
        if self.render_mode == "human":
            self.render()

    def render(self) -> Any:
        """The scene as an image (height, width, 3) uint8 in mode `rgb_array`; shown in a window in mode `human`.

        Raises:
            RuntimeError: mode `human` without a display.
        """
        if self._trail is None:
            gymnasium.logger.warn("render: make the environment with render_mode='rgb_array' or 'human' first")
            return None
        if self._renderer is None:
            from formation_env.rendering.renderer import Renderer

            self._renderer = Renderer(self.scenario, str(self.render_mode))
        return self._renderer.draw(self.simulation, self._trail)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
