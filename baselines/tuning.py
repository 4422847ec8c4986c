"""The search that found the gains in configs/baselines: differential evolution on the tuning seeds.

What is searched are decades of gains, in stages: gains of a later stage matter little to those of an earlier one. All
candidates of a generation fly the same episodes side by side, so they differ by their gains alone.
"""

import copy
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import typer
from numpy.typing import NDArray
from scipy.optimize import Bounds, differential_evolution

from baselines.registry import make_policy, read_gains
from baselines.side_by_side import SideBySide
from formation_env.dynamics.base import Array
from formation_env.evaluation import Policy, evaluate
from formation_env.files import write_texts
from formation_env.scenario import Scenario, config_folder, load_scenario, scenario_names
from formation_env.seeds import seeds
from formation_env.settings import ConfigError, load_yaml


@dataclass(frozen=True)
class Knob:
    """Gains that are turned together.

    Attributes:
        keys: dotted paths of the gains; a number is an axis.
        low: least value, in decades.
        high: greatest value, in decades.
    """

    keys: tuple[str, ...]
    low: float
    high: float


def _regulator(section: str) -> tuple[Knob, ...]:
    """Weights of a regulator: along-track and cross-track position weights stay 1, since only ratios matter."""
    return (
        Knob((f"{section}.position.0",), -2, 2),
        Knob((f"{section}.velocity_s2.0", f"{section}.velocity_s2.1"), 2, 8),
        Knob((f"{section}.velocity_s2.2",), 2, 8),
        Knob((f"{section}.control_s2.0", f"{section}.control_s2.1"), 0, 8),
        Knob((f"{section}.control_s2.2",), 0, 8),
    )


STAGES: Final[dict[str, tuple[tuple[Knob, ...], ...]]] = {
    "lqr": ((Knob(("expected_cost.floor",), -5, -2), Knob(("expected_cost.price_scale",), -0.5, 0.5)),),
    "lqr_tracking": (_regulator("transfer"), _regulator("hold")),
    "smc": (
        (
            *(Knob((f"surface.decay_per_s.{axis}",), -4.5, -1.5) for axis in range(3)),
            Knob(("reaching.eps_m_s",), -4, 0),
            Knob(("reaching.q_per_s",), -4.5, -1.5),
            Knob(("boundary_m",), -1, 4),
        ),
    ),
}
"""Knobs of each policy, stage by stage. A stage of the transfer is left out where there is none."""


def costs(policies: Sequence[Policy], scenario: Scenario, episode_seeds: Sequence[int]) -> Array:
    """Mean cost (policies,) over the same episodes, minus the mean return, m/s."""
    flown = evaluate(SideBySide(policies), scenario, [*episode_seeds] * len(policies))
    per_policy: Array = -flown["return"].to_numpy(float).reshape(len(policies), -1).mean(axis=1)
    return per_policy


def first_gains(policy: str) -> dict[str, Any]:
    """What a search begins with: the policy's section of default.yaml, which has every knob."""
    path = config_folder("baselines") / "default.yaml"
    read_gains(policy, path)  # refuses what is wrong in it
    section: dict[str, Any] = load_yaml(path)[policy]
    return section


def turn(gains: dict[str, Any], knobs: Sequence[Knob], decades: NDArray[np.float64]) -> dict[str, Any]:
    """Gains with the knobs at 10^decades, to three digits."""
    turned = copy.deepcopy(gains)
    for knob, decade in zip(knobs, decades, strict=True):
        for key in knob.keys:
            *parents, last = key.split(".")
            target: Any = turned
            for part in parents:
                target = target[part]
            target[int(last) if last.isdigit() else last] = float(f"{10.0**decade:.3g}")
    return turned


def read(gains: dict[str, Any], knob: Knob) -> float:
    """Where a knob stands, in decades, within its limits."""
    value: Any = gains
    for part in knob.keys[0].split("."):
        value = value[int(part) if part.isdigit() else part]
    return float(np.clip(np.log10(max(value, 1e-30)), knob.low, knob.high))


def search(
    name: str,
    scenario: Scenario,
    gains: dict[str, Any],
    knobs: Sequence[Knob],
    episode_seeds: Sequence[int],
    generations: int,
    progress: Callable[[], None] = lambda: None,
) -> tuple[dict[str, Any], float]:
    """One stage: the best gains that differential evolution finds, and their cost, m/s.

    Args:
        name: the policy.
        scenario: what it flies.
        gains: what to begin with; gains without a knob stay.
        knobs: what to turn.
        episode_seeds: one per episode.
        generations: of differential evolution.
        progress: called after each.
    """

    def cost(decades: Any, /) -> Any:
        candidates = [make_policy(name, scenario, turn(gains, knobs, column)) for column in decades.T]
        return costs(candidates, scenario, episode_seeds)

    result = differential_evolution(
        cost,
        Bounds(*np.transpose([(knob.low, knob.high) for knob in knobs])),
        x0=np.array([read(gains, knob) for knob in knobs]),
        popsize=5,
        maxiter=generations,
        tol=0,
        polish=False,
        updating="deferred",
        vectorized=True,
        rng=np.random.default_rng(0),
        callback=lambda intermediate_result: progress(),
    )
    return turn(gains, knobs, result.x), float(result.fun)


def stages(name: str, scenario: Scenario) -> list[tuple[Knob, ...]]:
    """The stages of a policy that matter to a scenario."""
    transfers = any(scenario.steps(phase.transfer_periods) for phase in scenario.phases)
    return [knobs for knobs in STAGES[name] if transfers or not knobs[0].keys[0].startswith("transfer")]


def tune(
    scenarios: Annotated[list[str] | None, typer.Argument(help="Names or YAML files; all but the thesis's.")] = None,
    policy: Annotated[str, typer.Option(help=f"One of {', '.join(STAGES)}.")] = "lqr",
    episodes: Annotated[int, typer.Option(min=2, help="Tuning seeds to fly.")] = 64,
    generations: Annotated[int, typer.Option(min=1, help="Of differential evolution, in each stage.")] = 30,
    out: Annotated[Path | None, typer.Option(help="Folder of the gain files; configs/baselines.")] = None,
) -> None:
    """Search the gains of a policy and write them to configs/baselines/SCENARIO.yaml."""
    if policy not in STAGES:
        raise typer.BadParameter(f"--policy: {policy!r} has no gains to search; known: {', '.join(STAGES)}")
    folder = out or config_folder("baselines")
    for name in scenarios or [name for name in scenario_names() if not name.startswith("thesis")]:
        try:
            cost = _tune_one(policy, name, episodes, generations, folder)
        except ConfigError as error:
            raise typer.BadParameter(str(error)) from None
        typer.echo(f"{name} {policy}: {cost:.4f} m/s")


def _tune_one(policy: str, name: str, episodes: int, generations: int, folder: Path) -> float:
    """Search, write, and give the cost, m/s."""
    scenario, episode_seeds = load_scenario(name), seeds("tuning", episodes)
    path = folder / f"{Path(name).stem}.yaml"
    gains, cost = first_gains(policy), np.inf
    todo = stages(policy, scenario)
    with typer.progressbar(length=generations * len(todo), label=f"{name} {policy}") as bar:
        for knobs in todo:
            gains, cost = search(policy, scenario, gains, knobs, episode_seeds, generations, lambda: bar.update(1))
    command = f"python -m baselines tune {name} --policy {policy} --episodes {episodes} --generations {generations}"
    comment = f"{command}\nseeds {episode_seeds[0]} to {episode_seeds[-1]}, mean cost {cost:.4f} m/s"
    text = path.read_text() if path.is_file() else f"# Gains of the classical policies for {Path(name).stem}.\n"
    write_texts(folder, {path.name: replace_section(text, policy, section(policy, gains, comment))})
    return cost


def section(policy: str, gains: dict[str, Any], comment: str) -> str:
    """A policy's section of a gain file, as text with a comment above it."""
    from ruamel.yaml import YAML

    yaml, stream = YAML(typ="safe", pure=True), StringIO()
    yaml.default_flow_style, yaml.width = None, 120
    yaml.width, yaml.sort_base_mapping_type_on_output = 120, False  # type: ignore[assignment]
    yaml.dump({policy: gains}, stream)
    return "".join(f"# {line}\n" for line in comment.splitlines()) + stream.getvalue()


def replace_section(text: str, policy: str, new: str) -> str:
    """A gain file's text with a policy's section, and the comment right above it, replaced, or added at its end."""
    old = re.compile(rf"^(?:#.*\n)*{policy}:.*\n(?:[ \t].*\n|\n(?=[ \t]))*", re.MULTILINE)
    if old.search(text):
        return old.sub(lambda _: new, text, count=1)
    return f"{text.rstrip()}\n\n{new}"
