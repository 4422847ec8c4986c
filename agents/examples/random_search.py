"""Gymnasium's own loop: random search of a linear policy's gains, one episode at a time.

    python -m agents.examples.random_search FormationKeeping-v0 --tries 300

Each try perturbs the best gains at random; the step size grows after a success and shrinks after a failure (the (1+1)
evolution strategy with the one-fifth rule, Rechenberg 1973). All tries fly the same few training seeds.
"""

from typing import Annotated

import gymnasium
import numpy as np
import typer
from numpy.typing import NDArray

import formation_env  # noqa: F401 (registers the environments)
from agents.policy.throttle import throttle
from formation_env.evaluation.seeds import seeds
from formation_env.task.observation import SLICES

app = typer.Typer(add_completion=False)
Env = gymnasium.Env[NDArray[np.float32], NDArray[np.float32]]
INPUT = SLICES["error_log"]
"""The policy reads the compressed error alone: three positions, three velocities."""
POWER = 3.0
"""p of the thrust sign(z) |z|^p for the policy's output z."""
INITIAL_WIDTH = 0.3
"""First standard deviation of the changes: inputs and outputs are of order 1."""
GROWTH, SHRINKAGE = 0.2, -0.05
"""Logarithmic change of that after a success and after a failure: in balance if every fifth try succeeds."""
VALIDATION_EPISODES = 10


def fly(env: Env, gains: NDArray[np.float64], seed: int) -> float:
    """One episode's return, m/s: minus (delta-v + 0.01 times the mean error in m)."""
    observation, _ = env.reset(seed=seed)
    total, ended = 0.0, False
    while not ended:
        z = np.clip(gains @ observation[INPUT], -1, 1)
        observation, reward, terminated, truncated, _ = env.step(throttle(z, POWER))
        total += float(reward)
        ended = terminated or truncated
    return total


def search(env_id: str, tries: int, episodes: int, seed: int) -> tuple[NDArray[np.float64], float, float]:
    """Search for gains.

    Args:
        env_id: a registered id.
        tries: gains to try.
        episodes: training seeds that each try flies.
        seed: of the search.

    Returns:
        Best gains (3, 6), and the mean costs of zero gains and of these on the validation seeds, m/s.
    """
    env: Env = gymnasium.make(env_id)
    rng = np.random.default_rng(seed)
    training, validation = seeds("training", episodes), seeds("validation", VALIDATION_EPISODES)

    def cost(gains: NDArray[np.float64], flown: range) -> float:
        return -float(np.mean([fly(env, gains, one) for one in flown]))

    best, width = np.zeros((3, 6)), INITIAL_WIDTH
    least = before = cost(best, training)
    for number in range(1, tries + 1):
        gains = best + width * rng.normal(size=best.shape)
        tried = cost(gains, training)
        success = tried <= least
        if tried < least:
            best, least = gains, tried
            typer.echo(f"try {number}: costs {least:.3f} m/s, without gains {before:.3f}")
        width *= np.exp(GROWTH if success else SHRINKAGE)
    return best, cost(np.zeros_like(best), validation), cost(best, validation)


@app.command()
def main(
    env_id: Annotated[str, typer.Argument(help="A registered id.")] = "FormationKeeping-v0",
    tries: Annotated[int, typer.Option(min=1)] = 300,
    episodes: Annotated[int, typer.Option(min=1, help="Training seeds of each try.")] = 4,
    seed: Annotated[int, typer.Option(min=0)] = 0,
) -> None:
    """Search gains, and print their cost on seeds that the search has not seen."""
    gains, before, after = search(env_id, tries, episodes, seed)
    typer.echo(f"gains:\n{gains.round(3)}\nmean cost on validation seeds: {after:.3f} m/s, without gains {before:.3f}")


if __name__ == "__main__":
    app()
