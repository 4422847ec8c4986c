"""Training: a model, its batched environment and its validation, from start to end or to the interrupt."""

from pathlib import Path

import torch
from stable_baselines3.common.logger import configure
from tqdm import tqdm

from agents.models import make_model
from agents.runs import TENSORBOARD, Run, start_run
from agents.validation import Validation
from agents.vec_env import Sb3VecEnv
from formation_env.seeds import seeds
from formation_env.settings import ConfigError


def training_seeds(seed: int, rows: int) -> range:
    """Seeds of the rows' environments: of the training split, and others for each seed of a run.

    Raises:
        ConfigError: there are not so many.
    """
    try:
        return seeds("training", (seed + 1) * rows)[-rows:]
    except ValueError:
        raise ConfigError(f"seed: no training seeds are left for {rows} rows, got {seed}") from None


def train(run: Run, folder: Path) -> bool:
    """Train as the run says, and keep all in its folder. An interrupt (Ctrl-C) ends the training and saves.

    Returns:
        Whether the training came to its end.

    Raises:
        ConfigError: the folder holds a run already, or the seed is too large.
        OSError: the folder cannot be written.
    """
    first = training_seeds(run.seed, run.agent.rows)[0]
    start_run(run, folder)
    torch.set_num_threads(run.threads)
    env = Sb3VecEnv(run.agent.rows, run.scenario, run.agent.reward_scale, run.agent.throttle_power, stagger=True)
    model = make_model(run.agent, env, run.seed)
    env.seed(first)
    model.set_logger(configure(str(folder / TENSORBOARD), ["tensorboard"]))
    finished = True
    with tqdm(total=run.steps, unit="step", unit_scale=True, dynamic_ncols=True, smoothing=0.1) as bar:
        validation = Validation(run, folder, bar)
        try:
            model.learn(run.steps, validation)
            validation.note()
        except KeyboardInterrupt:
            finished = False
            validation.save_last()
    model.logger.close()
    return finished
