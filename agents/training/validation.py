"""Validation during training: learning curve, best policy and checkpoints."""

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, Literal

import pandas as pd
from stable_baselines3.common.callbacks import BaseCallback
from tqdm import tqdm

from agents.algorithms.to_actor import actor_of
from agents.policy.actor import to_bytes
from agents.training.checkpoint import State, restore_random, save_checkpoint
from agents.training.run_folder import BEST, CHECKPOINT, CURVE, MODEL, Run, save_model
from formation_env.evaluation.rollout import Policy, evaluate
from formation_env.evaluation.seeds import seeds
from formation_env.evaluation.statistics import bootstrap_interval
from formation_env.files import replacing, write_files
from formation_env.task.scenario import Scenario

Outcome = Literal["finished", "interrupted", "out of time", "given up"]

MEANS: Final = ("delta_v_m_s", "position_error_mean_m")
"""Metrics recorded besides the return."""


def validate(policy: Policy, scenario: Scenario, episodes: int) -> dict[str, float]:
    """Mean return over the first validation seeds with its 95 % interval, m/s, and the means of `MEANS`."""
    table = evaluate(policy, scenario, seeds("validation", episodes))
    low, high = bootstrap_interval(table["return"].to_numpy(float))
    line = {"return": float(table["return"].mean()), "return_low": low, "return_high": high}
    return line | {name: float(table[name].mean()) for name in MEANS}


class Validation(BaseCallback):
    """Callback that flies the validation seeds, writes curve, best policy and checkpoint, and moves the bar.

    Attributes:
        lines: rows of the curve: steps, seconds, return, return_low, return_high, and `MEANS`.
        outcome: reason for the end of the training; None before it.
    """

    def __init__(
        self, run: Run, folder: Path, bar: "tqdm[Any]", reason_to_end: Callable[[], Outcome | None], state: State | None
    ) -> None:
        """Make the callback of one call of `learn`.

        Args:
            run: settings of the training.
            folder: of the run.
            bar: progress bar.
            reason_to_end: called before each rollout; a reason ends the training there.
            state: checkpoint from which the training continues, if there is one.
        """
        super().__init__()
        self._run = run
        self._folder = folder
        self._bar = bar
        self._reason_to_end = reason_to_end
        self._state = state
        self._start_s = time.perf_counter() - (state["notes"]["seconds"] if state else 0.0)
        self.lines: list[dict[str, float]] = state["notes"]["lines"] if state else []
        self.outcome: Outcome | None = None

    def _on_rollout_start(self) -> None:
        """Validate and save between two rollouts, when all updates of the last one are done."""
        if self._state is not None:
            restore_random(self.model, self._state)
            self._state = None
        if self.num_timesteps >= len(self.lines) * self._run.steps / self._run.validations:
            self.run_now()
        self.outcome = self._reason_to_end()
        if self.outcome is not None:
            self._save()
        if self._run.agent.use_sde:  # SB3 drew it before this call; a resumed training draws it here, so both do
            reset_noise: Any = self.model.policy.reset_noise
            reset_noise(self.training_env.num_envs)

    def _on_step(self) -> bool:
        self._bar.update(min(self.training_env.num_envs, self._run.steps - self._bar.n))
        return self.outcome is None

    def run_now(self) -> None:
        """Validate unless done at this step; keep the policy if it is the best so far; write a checkpoint."""
        if self.lines and self.lines[-1]["steps"] == self.num_timesteps:
            return
        best = max((line["return"] for line in self.lines), default=-math.inf)
        actor = actor_of(self.model, self._run.agent.throttle_power, self._run.scenario)
        line = validate(actor, self._run.scenario, self._run.validation_episodes)
        self.lines.append({"steps": self.num_timesteps, "seconds": self._seconds(), **line})
        self._log(line)
        if line["return"] > best:
            save_model(self.model, self._folder / MODEL)
            write_files(self._folder, {BEST: to_bytes(actor)})
        self._save()
        self._bar.set_postfix_str(f"return {line['return']:.3f}, best {max(best, line['return']):.3f} m/s")

    def _save(self) -> None:
        """Write the checkpoint and the curve."""
        notes = {"lines": self.lines, "seconds": self._seconds()}
        save_checkpoint(self._folder / CHECKPOINT, self.model, self._run, notes)
        with replacing(self._folder / CURVE) as temporary:
            pd.DataFrame(self.lines).to_csv(temporary, index=False, float_format="%.6g")

    def _seconds(self) -> float:
        """Time that the training has taken, without interruptions, s."""
        return time.perf_counter() - self._start_s

    def _log(self, line: dict[str, float]) -> None:
        for name, value in line.items():
            self.logger.record(f"validation/{name}", value)
        self.logger.dump(self.num_timesteps)
