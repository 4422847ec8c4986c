"""Validation during training: the curve, and the best model."""

import time
from pathlib import Path
from typing import Any, Final

import pandas as pd
from stable_baselines3.common.callbacks import BaseCallback
from tqdm import tqdm

from agents.runs import CURVE, LAST_MODEL, MODEL, LearnedPolicy, Run, save_model
from formation_env.evaluation import Policy, bootstrap_interval, evaluate
from formation_env.files import replacing
from formation_env.scenario import Scenario
from formation_env.seeds import seeds

MEANS: Final = ("delta_v_m_s", "position_error_mean_m")
"""Metrics noted besides the return."""


def validate(policy: Policy, scenario: Scenario, episodes: int) -> dict[str, float]:
    """Mean return over the first validation seeds with its 95 % interval, m/s, and the means of `MEANS`."""
    table = evaluate(policy, scenario, seeds("validation", episodes))
    low, high = bootstrap_interval(table["return"].to_numpy(float))
    line = {"return": float(table["return"].mean()), "return_low": low, "return_high": high}
    return line | {name: float(table[name].mean()) for name in MEANS}


class Validation(BaseCallback):
    """Flies the validation seeds from time to time; writes the curve, the best and the last model; moves the bar.

    Attributes:
        lines: of the curve: steps, seconds, return, return_low, return_high, and `MEANS`.
    """

    def __init__(self, run: Run, folder: Path, bar: "tqdm[Any]") -> None:
        super().__init__()
        self._run = run
        self._folder = folder
        self._bar = bar
        self._start_s = time.perf_counter()
        self.lines: list[dict[str, float]] = []

    def _on_rollout_start(self) -> None:
        """The model is whole here: all updates of the last rollout are done."""
        if self.num_timesteps >= len(self.lines) * self._run.steps / self._run.validations:
            self.note()

    def _on_step(self) -> bool:
        self._bar.update(min(self.training_env.num_envs, self._run.steps - self._bar.n))
        return True

    def note(self) -> None:
        """Validate now, if that has not been done at this step; save the last model, and the best if it is this."""
        if self.lines and self.lines[-1]["steps"] == self.num_timesteps:
            return
        best = max((line["return"] for line in self.lines), default=-float("inf"))
        line = validate(LearnedPolicy(self._run, self.model), self._run.scenario, self._run.validation_episodes)
        elapsed_s = round(time.perf_counter() - self._start_s, 1)
        self.lines.append({"steps": self.num_timesteps, "seconds": elapsed_s, **line})
        self._log(line)
        if line["return"] > best:
            save_model(self.model, self._folder / MODEL)
        self.save_last()
        self._bar.set_postfix_str(f"return {line['return']:.3f}, best {max(best, line['return']):.3f} m/s")

    def save_last(self) -> None:
        """Save the model as it is now, and the curve up to now."""
        save_model(self.model, self._folder / LAST_MODEL)
        with replacing(self._folder / CURVE) as temporary:
            pd.DataFrame(self.lines).to_csv(temporary, index=False, float_format="%.6g")

    def _log(self, line: dict[str, float]) -> None:
        for name, value in line.items():
            self.logger.record(f"validation/{name}", value)
        self.logger.dump(self.num_timesteps)
