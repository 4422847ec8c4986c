"""The single environment: one row of a simulation."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from formation_env.envs import interface
from formation_env.kernel.metrics import episode_metrics
from formation_env.kernel.simulation import RESULT_PLACES, Simulation
from formation_env.rendering.modes import FRAMES_PER_S, RENDER_MODES
from formation_env.task.loading import load_scenario
from formation_env.task.scenario import Scenario

Observation = NDArray[np.float32]

_ONLY_ROW = np.zeros(1, np.intp)
_REWARD, _TERMINATED, _TRUNCATED, _THRUST = (
    RESULT_PLACES[name] for name in ("reward", "terminated", "truncated", "thrust")
)


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
                `measured` tells), `process_noise_m_s2` and `thrust_noise`, see `kernel.simulation.StepNoises`.

        Raises:
            ConfigError: the scenario is wrong.
            ValueError: unknown render mode.
        """
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode: must be one of {self.metadata['render_modes']}, got {render_mode!r}")
        self.scenario = load_scenario(scenario)
        self._spec: EnvSpec | None = None
        self.render_mode = render_mode
        self.action_space = interface.action_space()
        self.observation_space = interface.observation_space()
        self.simulation = Simulation(self.scenario, 1)
        scalars = interface.info_scalars(self.scenario)
        self._info_scalars = [(name, RESULT_PLACES[result], kind) for name, (result, kind) in scalars.items()]
        self._analysis = analysis
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
        observations = self.simulation.new_observations()
        self.simulation.reset(_ONLY_ROW, observations, starts)
        if self._renderer is not None:
            self._renderer.restart()
        if self._trail is not None:
            self._trail.clear()
            self._show()
        return observations[0], self._info(self.simulation.first_row_results())

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
        observations = simulation.new_observations()
        simulation.step(observations)
        values = simulation.first_row_results()
        info = self._info(values)
        terminated, truncated = values[_TERMINATED] > 0.5, values[_TRUNCATED] > 0.5
        if terminated or truncated:
            info[interface.TOTALS] = {name: float(value[0]) for name, value in episode_metrics(simulation).items()}
        if self._trail is not None:
            self._show()
        return observations[0], values[_REWARD], terminated, truncated, info

    def _info(self, values: list[float]) -> dict[str, Any]:
        """Info of the last step, from the results of the one row."""
        simulation = self.simulation
        info: dict[str, Any] = {name: simulation.first_row_state(name) for name in interface.INFO_STATES}
        info[interface.INFO_THRUST] = np.array(values[_THRUST : _THRUST + 3])
        for name, place, kind in self._info_scalars:
            info[name] = kind(values[place])
        if self._analysis:
            info |= {name: value[0] for name, value in interface.analysis_infos(simulation).items()}
        return info

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
