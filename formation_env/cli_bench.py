"""The commands of `formation-env env` that measure and compile. What they need is imported when they run."""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from formation_env.cli_errors import FAILED, Interrupted
from formation_env.cli_options import Envs, Seed
from formation_env.cli_policies import make_policy

if TYPE_CHECKING:
    import pandas as pd

    from formation_env.evaluation.soak import Reading

MAX_ROWS: Final = 1_000_000
MAX_STEPS: Final = 1e12
LINE_INTERVAL_S: Final = 10.0
"""Time between two lines of progress on stderr."""

DETAILED: Final = "FormationKeeping-v0"
"""Environment that is looked at in detail unless others are named."""
POLICY: Final = "lqr"
"""Policy whose evaluation is timed."""

Rows = Annotated[int, typer.Option(min=1, max=MAX_ROWS, help="Rows of the batched environment.")]


def bench(
    envs: Envs = None,
    rows: Rows = 4096,
    rivals: Annotated[bool, typer.Option("--rivals", help="Also those of other packages that are installed.")] = False,
    max_rows: Annotated[
        int, typer.Option(min=1, max=MAX_ROWS, help="Largest batch of the time per row against rows.")
    ] = MAX_ROWS,
    plot: Annotated[Path | None, typer.Option(dir_okay=False, help="PNG file of the time per row.")] = None,
) -> None:
    """Measure steps per second next to Gymnasium's own environments; time by stage, time and memory per row.

    All environments are in the table of steps per second; the first one's, or else Keeping's, are looked at in detail.
    """
    from formation_env.evaluation import bench as benchmark
    from formation_env.files import check_writable
    from formation_env.settings import ConfigError
    from formation_env.task.loading import load_scenario

    chosen: Sequence[str] = envs or benchmark.DEFAULT
    for env in chosen:
        load_scenario(env)
    if plot is not None:
        if plot.suffix.lower() != ".png":
            raise ConfigError(f"--plot: must end in .png, got {plot}")
        check_writable(plot.parent)
    detailed = envs[0] if envs else DETAILED
    for heading, is_cached in (("new process", True), ("new process, nothing compiled before", False)):
        times = ", ".join(f"{name} {seconds:.2f} s" for name, seconds in benchmark.startup(is_cached).items())
        typer.echo(f"{heading}: {times}")
    _print_ratios(detailed)
    _print_rates(benchmark.table(rows, chosen))
    if rivals:
        others, left_out = benchmark.beside_rivals(detailed)
        typer.echo("\n".join(left_out))
        if len(others):
            _print_rates(others)
    _print_row(detailed, rows, max_rows, plot)


def _print_ratios(env: str) -> None:
    """Print how fast an environment steps in the situations that matter, each line as it is measured."""
    from formation_env.evaluation.bench_ratios import ratios
    from formation_env.task.loading import load_scenario

    scenario = load_scenario(env)
    policy = make_policy(POLICY, scenario)
    assert policy is not None
    typer.echo(f"{'':44s} {'ns':>8s}  {'ratio':>5s}  to")
    for each in ratios(env, policy, scenario):
        typer.echo(f"{each.case:44s} {each.ns_per_step:8.1f}  {each.ratio:5.2f}  {each.reference}")


def _print_rates(rates: "pd.DataFrame") -> None:
    """Print a table of steps per second."""
    formats = {"steps_per_s": "{:,.0f}".format, "x_cartpole": "{:.3f}".format}
    typer.echo(rates.to_string(index=False, formatters=formats))


def _print_row(env: str, rows: int, max_rows: int, plot: Path | None) -> None:
    """Print time by stage, memory, and time against rows of an environment, and plot the last."""
    import pandas as pd

    from formation_env.evaluation.bench_rows import ROWS, bytes_per_row, plot_time_per_row, time_per_row
    from formation_env.kernel.stage_times import stage_times
    from formation_env.task.loading import load_scenario

    scenario = load_scenario(env)
    typer.echo(f"\n{env}, {rows} rows")
    stages = pd.DataFrame(stage_times(scenario, rows).items(), columns=["stage", "ns_per_row"])
    typer.echo(stages.to_string(index=False, float_format="{:.2f}".format))
    typer.echo("\n" + bytes_per_row(scenario, rows).to_string(index=False, float_format="{:.1f}".format))
    times = time_per_row(env, [each for each in ROWS if each <= max_rows])
    typer.echo("\n" + times.to_string(index=False, float_format="{:,.1f}".format))
    if plot is not None:
        plot.parent.mkdir(parents=True, exist_ok=True)
        plot_time_per_row(times, env, plot)
        typer.echo(plot)


def compile_programs(envs: Envs = None) -> None:
    """Compile the environments' programs into numba's cache, for images and CI; the registered ids by default.

    The cache holds the code for this processor, this version of numba and these source files.
    """
    from formation_env.evaluation.fill_cache import fill_cache
    from formation_env.registration import ENV_IDS, SWARM_IDS
    from formation_env.task.loading import load_scenario

    chosen: Sequence[str] = envs or (*ENV_IDS, *SWARM_IDS)
    for env in chosen:
        load_scenario(env)
    folder = None
    for env in chosen:
        filled = fill_cache(env)
        origins = ", ".join(f"{name} {origin}" for name, origin in filled.origins.items())
        typer.echo(f"{env:28s} {filled.seconds:6.1f} s  {origins}")
        folder = filled.folder
    if folder is None:
        raise RuntimeError("no folder of a cache can be written; set NUMBA_CACHE_DIR to one")
    typer.echo(f"cache: {folder}")


def soak(
    env: Annotated[str, typer.Argument(help="Registered id, scenario name or YAML file.")] = "FormationKeeping-v0",
    steps: Annotated[float, typer.Option(min=1, max=MAX_STEPS, help="Steps of all rows together, such as 1e8.")] = 1e8,
    rows: Rows = 4096,
    seed: Seed = 0,
    tolerance_mib: Annotated[float, typer.Option(min=0, help="Growth of the memory that is no fault, MiB.")] = 8.0,
) -> None:
    """Fly many steps with random actions and watch the resident memory. Exit code 1 if it grows.

    Growth counts from the end of a warm-up of one episode.
    """
    from formation_env.evaluation.soak import fly, growth_mib
    from formation_env.task.loading import load_scenario

    scenario, progress = load_scenario(env), _Progress(int(steps))
    readings: list[Reading] = []
    try:
        for reading in fly(scenario, rows, int(steps), progress, seed):
            readings.append(reading)
            memory = "memory unknown here" if reading.mib is None else f"{reading.mib:.1f} MiB"
            typer.echo(f"{reading.steps:>16,} steps  {reading.episodes:>12,} episodes  {memory}")
    except KeyboardInterrupt:
        raise Interrupted(f"interrupted after {progress.done:,} steps; {_in_words(growth_mib(readings))}") from None
    growth = growth_mib(readings)
    typer.echo(_in_words(growth))
    if growth is not None and growth > tolerance_mib:
        typer.echo(f"error: memory grew by more than {tolerance_mib:g} MiB", err=True)
        raise typer.Exit(FAILED)


def _in_words(growth_mib: float | None) -> str:
    return "growth of the memory unknown" if growth_mib is None else f"memory grew by {growth_mib:.1f} MiB"


class _Progress:
    """Lines on stderr that say how far a flight is.

    Attributes:
        done: steps flown.
    """

    def __init__(self, total: int) -> None:
        self.done = 0
        self._total = total
        self._start = self._last = time.monotonic()

    def __call__(self, done: int) -> None:
        self.done = done
        now = time.monotonic()
        if now - self._last < LINE_INTERVAL_S:
            return
        self._last, elapsed = now, now - self._start
        left = elapsed * max(self._total / done - 1, 0.0)
        typer.echo(f"soak: {done / self._total:.0%} after {elapsed:.0f} s, about {left:.0f} s left", err=True)
