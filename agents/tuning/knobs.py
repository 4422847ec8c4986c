"""What is searched. To search another hyperparameter that is a real number: a line in `KNOBS`."""

from dataclasses import asdict
from typing import Final

from agents.hyperparameters import SETTINGS, AgentSettings, Algorithm
from baselines.tuning.search_space import SearchDimension as Knob
from baselines.tuning.search_space import apply as turn
from baselines.tuning.search_space import current_values as read
from formation_env.settings import build

_EXPLORATION: Final = Knob(("log_std_init",), -5, -1, log=False)

KNOBS: Final[dict[Algorithm, tuple[Knob, ...]]] = {
    "ppo": (
        Knob(("learning_rate",), 3e-6, 1e-3),
        Knob(("clip_range",), 0.02, 0.3),
        Knob(("gae_lambda",), 0.8, 1, log=False),
        Knob(("entropy_coef",), 0, 0.01, log=False),
        _EXPLORATION,
    ),
    "sac": (
        Knob(("learning_rate",), 3e-6, 1e-3),
        Knob(("tau",), 1e-3, 0.05),
        Knob(("gamma",), 0.9, 1, log=False),
        Knob(("entropy_init",), 1e-6, 1e-2),
        Knob(("target_entropy",), -20, 0, log=False),
        _EXPLORATION,
    ),
}
"""Algorithm -> its knobs; what comes before reinforcement learning has none, since all trials share it."""


def present(algorithm: Algorithm, agent: AgentSettings) -> dict[str, float]:
    """Where the knobs stand, by name, cut to their limits."""
    knobs = KNOBS[algorithm]
    values = read(asdict(agent), knobs)
    return {knob.name: min(max(values[knob.name], knob.low), knob.high) for knob in knobs}


def turned(algorithm: Algorithm, agent: AgentSettings, values: dict[str, float]) -> AgentSettings:
    """Hyperparameters with the knobs at values, by name, to three digits."""
    return build(SETTINGS[algorithm], turn(asdict(agent), KNOBS[algorithm], values), "tune")
