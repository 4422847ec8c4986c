"""The commands of `formation-env baselines`. What they need is imported when they run."""

from pathlib import Path
from typing import Annotated, ClassVar

import typer

from baselines.cli_report import BoundEpisodes, ReportArguments, write_report_page
from baselines.cli_tune import EXAMPLE, tune
from formation_env.cli_errors import DISTRIBUTION
from formation_env.cli_group import Group, add_command, command_line, make_app
from formation_env.cli_options import PROCESSES, Envs, Episodes, Out, Policies, Processes, Resume

NAME = "baselines"


class BaselinesGroup(Group):
    """The group `baselines`."""

    renamed: ClassVar = {"reproduce": f"{DISTRIBUTION} baselines thesis", "render": f"{DISTRIBUTION} env render"}
    renamed_options: ClassVar = {
        command: {"--env": f"an argument, {DISTRIBUTION} baselines {command} ENV..."} for command in ("report", "sweep")
    }


app = make_app(
    "Classical guidance and control policies: compare, sweep, tune, and reproduce the thesis.", BaselinesGroup
)


@app.command("list", epilog=f"Example: {DISTRIBUTION} baselines list")
def list_policies() -> None:
    """List the classical policies: name and description."""
    import inspect

    from baselines.controllers.registry import POLICIES

    for name, policy in POLICIES.items():
        typer.echo(f"{name:18s} {(inspect.getdoc(policy) or '').partition(chr(10))[0]}")


def report(arguments: ReportArguments) -> None:
    """Write the report of the classical policies."""

    def write() -> Path:
        from baselines.experiments.policy_factories import classical
        from baselines.report import write_report
        from baselines.report.swarm_table import swarm_tables
        from baselines.report.table import no_tables
        from formation_env.task.loading import ENV_IDS

        envs = arguments.envs or list(ENV_IDS)
        policies, command = classical(arguments.policy or (), envs), command_line(NAME)
        tables = no_tables if arguments.envs else swarm_tables(arguments.episodes)
        return write_report(policies, envs, arguments.options(), arguments.out, command, arguments.processes, tables)

    write_report_page(arguments.out, arguments.resume, write)


add_command(
    app,
    "report",
    ReportArguments,
    report,
    f"{DISTRIBUTION} baselines report keeping --policy lqr --policy mpc --episodes 20 --slow-episodes 20",
)


@app.command(epilog=f"Example: {DISTRIBUTION} baselines sweep keeping --policy lqr --episodes 50 --resume")
def sweep(
    envs: Envs = None,
    policy: Policies = None,
    episodes: Episodes = 20,
    bound_episodes: BoundEpisodes = 5,
    resume: Resume = False,
    out: Out = Path("reports/sweep"),
    processes: Processes = PROCESSES,
) -> None:
    """Plot the delta-v against error trade-off, and cost under perturbed conditions."""

    def write() -> Path:
        from baselines.controllers.registry import reference_policies, slow_policies
        from baselines.experiments.policy_factories import classical
        from baselines.report.write_sweep import SweepOptions, write_sweep
        from formation_env.task.loading import ENV_IDS

        flown = envs or list(ENV_IDS)
        left_out = (*slow_policies(), *reference_policies())
        names = policy or [name for name in classical() if name not in left_out]
        options = SweepOptions(episodes=episodes, bound_episodes=bound_episodes, resume=resume)
        return write_sweep(classical(names, flown), flown, options, out, command_line(NAME), processes)

    write_report_page(out, resume, write)


@app.command(epilog=f"Example: {DISTRIBUTION} baselines swarm swap --episodes 20 --outage-s 300 --outage-s 1200")
def swarm(
    envs: Envs = None,
    episodes: Episodes = 100,
    outage_s: Annotated[
        list[float] | None,
        typer.Option(
            min=1.0, help="Mean outage of the links between followers, s; may be repeated.", show_default="as they are"
        ),
    ] = None,
    scp: Annotated[bool, typer.Option("--scp", help="Also the centralised plan, seconds for each episode.")] = False,
    out: Out = Path("reports"),
) -> None:
    """Compare architectures and avoidance of several followers: cost, violations, collisions, least distance."""
    from baselines.report.swarm_table import LAYERS, POLICIES, SCP, outage_table, swarm_table
    from formation_env.files import check_writable, write_texts
    from formation_env.registration import SWARM_IDS
    from formation_env.settings import ConfigError
    from formation_env.task.loading import load_scenario

    chosen = envs or list(SWARM_IDS)
    for env in chosen:
        if load_scenario(env).followers == 1:
            raise ConfigError(f"{env}: has one follower; baselines report compares policies there")
    check_writable(out)
    plan = (SCP,) if scp else ()
    if outage_s:
        table = outage_table(chosen, episodes, outage_s, (*LAYERS, *plan))
    else:
        table = swarm_table(chosen, episodes, (*POLICIES, *plan))
    write_texts(out, {f"{table.name}.md": table.markdown()})
    typer.echo(table.markdown())


app.command(epilog=f"Example: {EXAMPLE}")(tune)


@app.command(epilog=f"Example: {DISTRIBUTION} baselines thesis --episodes 10 --step-s 5 --no-models")
def thesis(
    episodes: Episodes = 50,
    out: Out = Path("reports/thesis"),
    step_s: Annotated[
        float, typer.Option(min=0.1, max=60.0, help="Time step, s; a coarse step gives a quick look.")
    ] = 1.0,
    claims: Annotated[bool, typer.Option(help="Test the thesis's claims.")] = True,
    models: Annotated[bool, typer.Option(help="Compare the linear models with the nonlinear truth.")] = True,
    processes: Processes = PROCESSES,
) -> None:
    """Reproduce the source thesis: figures, claims and models, with one HTML page."""

    def write() -> Path:
        from baselines.thesis.write_thesis import ThesisOptions, write_thesis

        options = ThesisOptions(episodes=episodes, step_s=step_s, claims=claims, models=models)
        return write_thesis(out, options, command_line(NAME), processes)

    write_report_page(out, False, write)
