"""Print hashes of rollouts, so that a change that should not alter results can be held against its parent commit.

    python tests/rollout_hashes.py > before.txt
    ... edit ...
    python tests/rollout_hashes.py > after.txt; diff before.txt after.txt

Each line is a scenario, what flew it, and a hash of the bits of observations, rewards, ends, actions and infos. The
bits depend on the processor (compiled code and BLAS round differently), so hashes are compared on one machine and none
is committed.
"""

import argparse
import hashlib
from collections.abc import Iterable
from itertools import islice
from typing import Any

import gymnasium
import numpy as np

import agents
from agents.policy.library import shipped_paths
from baselines import POLICIES, make_policy
from formation_env import ENV_IDS, load_scenario, scenario_names

ROWS = 16
STEPS = {"mpc": 12, "lqr_nominal": 60}
PLANS_ARE_LONG = 10_000
"""Steps from which on a plan through the whole episode takes minutes."""
INFOS = ("true_state", "estimate", "accel_m_s2", "position_error_m", "nis", "measured", "phase")


def digest(parts: Iterable[Any]) -> str:
    """Hash of numbers, bit by bit."""
    found = hashlib.sha256()
    for part in parts:
        found.update(np.ascontiguousarray(part).tobytes())
    return found.hexdigest()[:16]


def numbers(infos: dict[str, Any]) -> list[Any]:
    """The numbers of a step's infos, in a fixed order."""
    ends = infos.get("episode_totals", {})
    return [infos[key] for key in INFOS] + [np.asarray(ends[key], float) for key in sorted(ends)]


def single(scenario: str, steps: int) -> str:
    """Hash of one environment under random actions, resets included."""
    env = gymnasium.make("FormationKeeping-v0", scenario=scenario)
    env.action_space.seed(5)
    observation, info = env.reset(seed=3)
    parts: list[Any] = [observation]
    for _ in range(steps):
        action = env.action_space.sample()
        observation, reward, terminated, truncated, info = env.step(action)
        parts += [observation, reward, terminated, truncated, *numbers(info)]
        if terminated or truncated:
            parts.append(env.reset()[0])
    return digest(parts)


def batched(scenario: str, policy: Any, steps: int) -> str:
    """Hash of a batch, autoreset included; without a policy the actions are random."""
    env = gymnasium.make_vec(
        "FormationKeeping-v0", num_envs=ROWS, vectorization_mode="vector_entry_point", scenario=scenario
    )
    env.action_space.seed(7)
    observations, _ = env.reset(seed=11)
    parts: list[Any] = [observations]
    for _ in range(steps):
        actions = env.action_space.sample() if policy is None else policy.predict(observations)[0]
        observations, rewards, terminated, truncated, infos = env.step(actions)
        parts += [actions, observations, rewards, terminated, truncated, *(infos[key] for key in INFOS)]
    return digest(parts)


def lines(steps: int) -> Iterable[str]:
    """Every scenario, by random actions single and batched, by every policy and by the learned ones made for it."""
    learned = {path.stem.split("_", 1)[1]: [] for path in shipped_paths()}
    for path in shipped_paths():
        learned[path.stem.split("_", 1)[1]].append(path.stem.split("_", 1)[0])
    for scenario in scenario_names():
        count = load_scenario(scenario).num_steps
        yield f"{scenario} single random {single(scenario, min(steps, count + 5))}"
        yield f"{scenario} batched random {batched(scenario, None, min(steps, count + 5))}"
        for name in POLICIES:
            if name == "lqr_nominal" and count > PLANS_ARE_LONG:
                continue
            flown = min(STEPS.get(name, steps), count + 5)
            yield f"{scenario} batched {name} {batched(scenario, make_policy(name, scenario), flown)}"
        for algorithm in learned.get(scenario, []):
            policy = agents.load_policy(algorithm, scenario)
            yield f"{scenario} batched {algorithm} {batched(scenario, policy, min(steps, count + 5))}"


def main() -> None:
    """Print the lines as they come."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=200, help="steps of each rollout")
    parser.add_argument("--lines", type=int, help="only the first lines")
    options = parser.parse_args()
    for line in islice(lines(options.steps), options.lines):
        print(line, flush=True)
    for env_id in ENV_IDS:
        print(f"{env_id} registered {digest([gymnasium.make(env_id).reset(seed=0)[0]])}")


if __name__ == "__main__":
    main()
