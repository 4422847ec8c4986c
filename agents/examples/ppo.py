"""PPO in one file in the style of CleanRL, on the batched environment: torch, no Stable-Baselines3.

    python -m agents.examples.ppo FormationKeeping-v0 --steps 2000000

Proximal policy optimisation (Schulman et al. 2017) with generalised advantages (Schulman et al. 2016). One call steps
all rows. Rows whose episode ends restart in the same step; their last observation is in `infos["final_obs"]`.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any

import gymnasium
import numpy as np
import torch
import typer
from torch import Tensor, nn
from torch.distributions import Normal

import formation_env  # noqa: F401 (registers the environments)
from agents.policy.actor import ACTIONS
from agents.policy.throttle import throttle
from formation_env.evaluation.rollout import evaluate
from formation_env.evaluation.seeds import seeds
from formation_env.task.observation import SIZE

app = typer.Typer(add_completion=False)
ROWS, LENGTH = 128, 128
"""Environments side by side, and steps of each between updates."""
BATCH, EPOCHS = 512, 5
"""Samples of a gradient step (larger batches learn more slowly per step), and passes over each rollout."""
GAMMA, LAMBDA, CLIP, VALUE_WEIGHT, MAX_GRADIENT = 0.995, 0.95, 0.2, 0.5, 0.5
"""Discount (200 steps ahead), and the usual values of Schulman et al. 2017 and CleanRL."""
LEARNING_RATE = 7e-4
REWARD_SCALE, POWER = 3.0, 3.0
"""Returns become of order 1; p of the thrust sign(z) |z|^p for a throttle z."""
VALIDATION_EPISODES = 64
VALIDATIONS = 20


class Agent(nn.Module):
    """Mean and standard deviation of the throttles, and the value of an observation."""

    def __init__(self, size: int, actions: int) -> None:
        super().__init__()
        self.actor, self.critic = _network(size, actions, 0.01), _network(size, 1, 1.0)
        self.log_std = nn.Parameter(torch.full((actions,), -1.0))

    def distribution(self, observations: Tensor) -> Normal:
        """Distribution of the throttles (..., 3)."""
        return Normal(self.actor(observations), self.log_std.exp())

    def value(self, observations: Tensor) -> Tensor:
        """Expected discounted rewards (...)."""
        values: Tensor = self.critic(observations).squeeze(-1)
        return values

    @torch.no_grad()
    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        """Thrusts without exploration, in the form that `evaluate` and the report call."""
        z = self.actor(torch.as_tensor(observation)).clamp(-1, 1)
        return throttle(z.numpy(), POWER), state


def _network(inputs: int, outputs: int, last_gain: float) -> nn.Sequential:
    layers = [nn.Linear(inputs, 64), nn.Linear(64, 64), nn.Linear(64, outputs)]
    for layer, gain in zip(layers, (2**0.5, 2**0.5, last_gain), strict=True):
        nn.init.orthogonal_(layer.weight, gain)
        nn.init.zeros_(layer.bias)
    return nn.Sequential(layers[0], nn.Tanh(), layers[1], nn.Tanh(), layers[2])


@dataclass(frozen=True)
class Rollout:
    """Transitions of a rollout: tensors (LENGTH, ROWS, ...)."""

    observations: Tensor
    throttles: Tensor
    log_probs: Tensor
    advantages: Tensor
    returns: Tensor


@torch.no_grad()
def fly(env: gymnasium.vector.VectorEnv, agent: Agent, observations: Any) -> tuple[Rollout, Any]:
    """Fly LENGTH steps in all rows; return the rollout and the last observations (ROWS, SIZE)."""
    steps = []
    for _ in range(LENGTH):
        seen = torch.as_tensor(observations)
        distribution = agent.distribution(seen)
        z = distribution.sample()  # type: ignore[no-untyped-call] # torch.distributions has no types
        observations, rewards, terminations, truncations, infos = env.step(throttle(z.clamp(-1, 1).numpy(), POWER))
        ended = terminations | truncations
        next_seen = torch.as_tensor(observations).clone()
        for row in np.flatnonzero(ended):
            next_seen[row] = torch.as_tensor(infos["final_obs"][row])
        # After a truncation the formation flies on, so its value counts; a termination is already penalised.
        next_values = agent.value(next_seen) * torch.as_tensor(~terminations)
        rewards = torch.as_tensor(REWARD_SCALE * rewards, dtype=torch.float32)
        log_probs = distribution.log_prob(z).sum(-1)  # type: ignore[no-untyped-call]
        steps.append((seen, z, log_probs, rewards, agent.value(seen), next_values, torch.as_tensor(ended)))
    seen, z, log_probs, rewards, values, next_values, ended = map(torch.stack, zip(*steps, strict=True))
    advantages = advantages_of(rewards, values, next_values, ended)
    return Rollout(seen, z, log_probs, advantages, advantages + values), observations


def advantages_of(rewards: Tensor, values: Tensor, next_values: Tensor, ended: Tensor) -> Tensor:
    """A_t = d_t + gamma lambda A_(t+1) up to an episode's end, with d_t = r_t + gamma V(s_(t+1)) - V(s_t).

    All tensors are (LENGTH, ROWS).
    """
    advantages, later = torch.zeros_like(rewards), torch.zeros_like(rewards[0])
    surprises = rewards + GAMMA * next_values - values
    for step in reversed(range(len(rewards))):
        later = surprises[step] + GAMMA * LAMBDA * later * ~ended[step]
        advantages[step] = later
    return advantages


def batches(rollout: Rollout) -> Iterator[tuple[Tensor, ...]]:
    """Yield batches of all steps in random order, EPOCHS times."""
    parts = (rollout.observations, rollout.throttles, rollout.log_probs, rollout.advantages, rollout.returns)
    flat = [part.flatten(0, 1) for part in parts]
    for _ in range(EPOCHS):
        for chosen in torch.split(torch.randperm(len(flat[0])), BATCH):
            yield tuple(part[chosen] for part in flat)


def learn(agent: Agent, optimizer: torch.optim.Optimizer, rollout: Rollout) -> None:
    """Update the agent on a rollout."""
    for observations, throttles, log_probs, advantages, returns in batches(rollout):
        new_log_probs = agent.distribution(observations).log_prob(throttles)  # type: ignore[no-untyped-call]
        ratio = (new_log_probs.sum(-1) - log_probs).exp()
        advantages = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
        actor_loss = -torch.min(ratio * advantages, ratio.clamp(1 - CLIP, 1 + CLIP) * advantages).mean()
        value_loss = (agent.value(observations) - returns).square().mean()
        optimizer.zero_grad()
        (actor_loss + VALUE_WEIGHT * value_loss).backward()
        nn.utils.clip_grad_norm_(agent.parameters(), MAX_GRADIENT)
        optimizer.step()


def train(env_id: str, steps: int, seed: int, reports: int) -> tuple[Agent, list[float]]:
    """Train an agent; return it and its mean costs on the validation seeds, before, during and after training, m/s."""
    torch.manual_seed(seed)
    torch.set_num_threads(1)  # more threads only wait for each other in networks this small
    env = gymnasium.make_vec(env_id, ROWS, vectorization_mode="vector_entry_point")
    observations, _ = env.reset(seed=seeds("training", (seed + 1) * ROWS)[-ROWS])
    agent = Agent(SIZE, ACTIONS)
    optimizer = torch.optim.Adam(agent.parameters(), LEARNING_RATE, eps=1e-5)
    costs, updates = [_cost(agent, env_id)], max(1, steps // (ROWS * LENGTH))
    for update in range(1, updates + 1):
        optimizer.param_groups[0]["lr"] = LEARNING_RATE * (1 - (update - 1) / updates)
        rollout, observations = fly(env, agent, observations)
        learn(agent, optimizer, rollout)
        if update * reports // updates > (update - 1) * reports // updates:
            costs.append(_cost(agent, env_id))
            typer.echo(f"{update * ROWS * LENGTH:>10,} steps: costs {costs[-1]:.3f} m/s, untrained {costs[0]:.3f}")
    return agent, costs


def _cost(agent: Agent, env_id: str) -> float:
    return -float(evaluate(agent, env_id, seeds("validation", VALIDATION_EPISODES))["return"].mean())


@app.command()
def main(
    env_id: Annotated[str, typer.Argument(help="A registered id.")] = "FormationKeeping-v0",
    steps: Annotated[int, typer.Option(min=1, help="Environment steps.")] = 2_000_000,
    seed: Annotated[int, typer.Option(min=0)] = 0,
    reports: Annotated[int, typer.Option(min=1, help="Number of evaluations during training.")] = VALIDATIONS,
) -> None:
    """Train PPO and print its cost on validation seeds."""
    train(env_id, steps, seed, reports)


if __name__ == "__main__":
    app()
