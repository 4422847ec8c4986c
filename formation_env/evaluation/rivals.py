"""Batched environments of other packages, stepped for a comparison of speed where they are installed.

None of these packages is a dependency: each is imported only when its stepper is made. Every stepper flies whole
episodes, resets included, in the fastest way that its package documents, and hands over what a learner reads.
"""

import importlib.metadata
import importlib.util
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

Stepper = Callable[[], int]
"""Steps a batch and returns the number of environment steps of all rows."""
ACTIONS: Final = 64
"""Random actions drawn beforehand, so that sampling does not count."""


@dataclass(frozen=True)
class Rival:
    """A batched environment of another package.

    Attributes:
        distribution: name of the package's distribution, whose version is shown.
        module: name under which it is imported.
        environment: the environment and what it computes, as the table shows them.
        install: what to type for it.
        rows: rows that a comparison uses unless others are asked for.
        make_stepper: makes the stepper of so many rows, compiled where the package compiles.
    """

    distribution: str
    module: str
    environment: str
    install: str
    rows: int
    make_stepper: Callable[[int], Stepper]

    @property
    def label(self) -> str:
        """Distribution, installed version and environment.

        Raises:
            importlib.metadata.PackageNotFoundError: the distribution is not installed.
        """
        return f"{self.distribution} {importlib.metadata.version(self.distribution)} {self.environment}"

    def is_installed(self) -> bool:
        """Whether the module can be found; it is not imported."""
        return importlib.util.find_spec(self.module) is not None


def gymnax_stepper(rows: int) -> Stepper:
    """One episode of gymnax's Pendulum-v1 per call: `jit` of a `scan` over steps of the `vmap` over rows.

    The actions are drawn beforehand; observations, rewards and ends of all steps are returned, as in gymnax's own
    example of a rollout. XLA uses all cores that the process may use; with 4096 rows one core can be faster than two.

    Args:
        rows: rows of the batch.
    """
    import gymnax
    import jax

    env, params = gymnax.make("Pendulum-v1")
    steps = int(params.max_steps_in_episode)
    step = jax.vmap(env.step, in_axes=(0, 0, 0, None))
    start, draw, first = jax.random.split(jax.random.PRNGKey(0), 3)
    _, states = jax.vmap(env.reset, in_axes=(0, None))(jax.random.split(start, rows), params)
    actions = jax.random.uniform(draw, (steps, rows, 1), minval=-params.max_torque, maxval=params.max_torque)

    def advance(carry: tuple[Any, Any], action: Any) -> tuple[tuple[Any, Any], tuple[Any, ...]]:
        key, now = carry
        key, drawn = jax.random.split(key)
        observation, after, *judged = step(jax.random.split(drawn, rows), now, action, params)
        return (key, after), (observation, *judged[:-1])

    fly = jax.jit(lambda carry: jax.lax.scan(advance, carry, actions))
    carry, _ = jax.block_until_ready(fly((first, states)))

    def run() -> int:
        nonlocal carry
        carry, _ = jax.block_until_ready(fly(carry))
        return steps * rows

    return run


def orbitalgym_stepper(rows: int) -> Stepper:
    """One episode of OrbitalGym's pursuit-evasion per call: `jit` of `vmap` over keys of its `belief_rollout`.

    Each side measures the other's position and tracks both vehicles with its linear Kalman filter: four filters of six
    states a step. This is the fastest of its sensors with a filter (own state, all states, or two sensors take longer),
    and the extended and the particle filter take longer still. Both sides coast, so no policy counts. XLA uses all
    cores.

    Args:
        rows: rows of the batch.
    """
    import jax

    fly, steps = _pursuit_with_filters()
    batch = jax.jit(jax.vmap(fly))
    keys = [jax.random.split(jax.random.PRNGKey(seed), rows) for seed in range(4)]
    jax.block_until_ready(batch(keys[0]))
    turns = itertools.cycle(keys)

    def run() -> int:
        jax.block_until_ready(batch(next(turns)))
        return steps * rows

    return run


def _pursuit_with_filters() -> tuple[Callable[[Any], Any], int]:
    """A function that flies an episode from a key and returns rewards, ends and estimates, and the episode's steps."""
    from dataclasses import replace

    import jax.numpy as jnp
    from orbitalgym import BySide, OrbitalGymEnv, make_pursuit_evasion
    from orbitalgym.belief.kf import KFBeliefUpdater, KFFromTruthInitializer
    from orbitalgym.dynamics.hcw import hcw_rtn_stm
    from orbitalgym.observations.range_limited import RangeLimitedObservation
    from orbitalgym.policies import ZeroControl
    from orbitalgym.rollout import belief_rollout

    config = make_pursuit_evasion()
    sensor = RangeLimitedObservation(layout=config.layout, sensor_range_m=1e5)
    env = OrbitalGymEnv(replace(config, guard_observation_fn=sensor, bandit_observation_fn=sensor))
    transition = hcw_rtn_stm(env.mean_motion, config.dt)
    update = KFBeliefUpdater(stm=transition, control_matrix=transition[:, 3:], process_noise=1e-4 * jnp.eye(6))
    initial = KFFromTruthInitializer(layout=env.layout, variance_diag=jnp.ones(6))
    coast = BySide(guard=ZeroControl(env.guard_command_cls, 1), bandit=ZeroControl(env.bandit_command_cls, 1))
    stateless = BySide(guard=lambda *_: None, bandit=lambda *_: None)
    starts, updates = BySide(guard=initial, bandit=initial), BySide(guard=update, bandit=update)

    def fly(key: Any) -> Any:
        flown, beliefs = belief_rollout(env, coast, stateless, starts, updates, key, config.max_steps)
        sides = (flown.sides.guard, flown.sides.bandit)
        return [side.reward for side in sides], flown.episode_done, beliefs.guard.mean, beliefs.bandit.mean

    return fly, int(config.max_steps)


def vbar_stepper(rows: int) -> Stepper:
    """One episode of vbar's `ApproachVectorEnv` per call, with random actions: numpy, one core.

    The measurements are exact, its default and its fastest: there is neither noise nor a filter.

    Args:
        rows: rows of the batch.
    """
    from vbar.scenarios import ApproachVectorEnv

    env = ApproachVectorEnv(num_envs=rows)
    env.reset(seed=0)
    env.action_space.seed(0)
    steps = int(env.cfg.max_steps)
    actions = itertools.cycle([env.action_space.sample() for _ in range(ACTIONS)])

    def run() -> int:
        for action in itertools.islice(actions, steps):
            env.step(action)
        return steps * rows

    return run


RIVALS: Final = (
    Rival(
        "orbitalgym",
        "orbitalgym",
        "pursuit-evasion, 4 Kalman filters",
        "pip install orbitalgym (Python 3.12 or newer)",
        2048,
        orbitalgym_stepper,
    ),
    Rival(
        "vbar", "vbar", "approach, exact measurements", "pip install vbar (Python 3.12 or newer)", 1024, vbar_stepper
    ),
    Rival("gymnax", "gymnax", "Pendulum-v1", "pip install gymnax six", 4096, gymnax_stepper),
)


def make_steppers(
    rows: int | None = None, rivals: Sequence[Rival] = RIVALS
) -> tuple[dict[int, dict[str, Stepper]], list[str]]:
    """Steppers of the rivals that are installed, and a line for each that is left out.

    Args:
        rows: rows of every batch; None takes each rival's own.
        rivals: the rivals to look for.

    Returns:
        The steppers by label, grouped by their rows, and why the others are missing.
    """
    groups: dict[int, dict[str, Stepper]] = {}
    left_out = []
    for rival in rivals:
        if not rival.is_installed():
            left_out.append(f"{rival.distribution} {rival.environment}: not installed; {rival.install}")
            continue
        count = rival.rows if rows is None else rows
        try:
            stepper = rival.make_stepper(count)
        except (ImportError, AttributeError) as error:  # something missing, or renamed since
            left_out.append(f"{rival.distribution} {rival.environment}: {error}; {rival.install}")
            continue
        groups.setdefault(count, {})[rival.label] = stepper
    return groups, left_out
