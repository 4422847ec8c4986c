"""Scenarios: how they are loaded, what they refuse and what they say then."""

import dataclasses
import re
from pathlib import Path

import pytest
from env_helpers import mean_motion

from formation_env import ENV_IDS, ConfigError, FormationEnv, Scenario, Spacecraft, load_scenario, scenario_names
from formation_env.formations import AtLeader, Following, SpaceCircle
from formation_env.task.loading import config_folder
from formation_env.task.phases import Limits, Phase, Start

PHASES = "phases: [{formation: {kind: following}, hold_orbits: 1}]\n"


def write(folder: Path, text: str | bytes) -> Path:
    path = folder / "mission.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize("name", scenario_names())
def test_every_shipped_scenario_loads(name: str) -> None:
    """A scenario is one file: by its name and by its path it is the same."""
    path = config_folder("scenarios") / f"{name}.yaml"
    scenario = load_scenario(name)
    assert scenario == load_scenario(path) == load_scenario(str(path))
    assert scenario.title


def test_registered_ids_have_scenarios_of_the_table() -> None:
    """The four ids of the project: time step, thrust limit, phases."""
    expected = {
        "FormationInitialization-v0": (0.005, [(0.5, 0.25)]),
        "FormationKeeping-v0": (0.002, [(0, 2)]),
        "FormationReconfiguration-v0": (0.01, [(0.4, 0.35)]),
        "FormationMission-v0": (0.01, [(0.5, 2), (0.4, 2)]),
    }
    for env_id, (max_accel, phases) in expected.items():
        scenario = load_scenario(ENV_IDS[env_id])
        assert scenario.dt_s == 30
        assert scenario.spacecraft.max_accel_m_s2 == max_accel
        assert [(p.transfer_orbits, p.hold_orbits) for p in scenario.phases] == phases
    assert len(ENV_IDS) == len(expected)


def test_a_scenario_passes_as_it_is() -> None:
    """The third way to name one."""
    scenario = load_scenario("keeping")
    assert load_scenario(scenario) is scenario


def test_a_relative_path_and_both_suffixes_load(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Paths are relative to the working directory, like everybody else's."""
    monkeypatch.chdir(tmp_path)
    write(tmp_path, PHASES).rename(tmp_path / "own.yml")
    assert load_scenario("own.yml").phases[0].formation == Following()


def test_numbers_with_an_exponent_are_numbers(tmp_path: Path) -> None:
    """YAML 1.2 reads 1e-3 as a number, and so must we."""
    path = write(tmp_path, PHASES + "process_noise_m_s2: 1e-3\norbit: {altitude_m: 500e3}\n")
    assert load_scenario(path).process_noise_m_s2 == 1e-3
    assert load_scenario(path).orbit.altitude_m == 500_000


def test_a_scenario_is_frozen_and_hashable() -> None:
    """What an environment was made with cannot change under it."""
    scenario = load_scenario("mission")
    with pytest.raises(dataclasses.FrozenInstanceError):
        scenario.dt_s = 1.0  # type: ignore[misc]
    with pytest.raises(dataclasses.FrozenInstanceError):
        scenario.phases[0].hold_orbits = 1.0  # type: ignore[misc]
    assert hash(scenario) == hash(load_scenario("mission"))


def test_replace_checks_again() -> None:
    """A changed copy is held to the same rules as a file."""
    scenario = load_scenario("keeping")
    assert dataclasses.replace(scenario, dt_s=10.0).dt_s == 10
    for wrong in ({"dt_s": -1.0}, {"dt_s": "30"}, {"dynamics": "kepler"}, {"phases": ()}, {"dt_s": 1e5}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            dataclasses.replace(scenario, **wrong)


@pytest.mark.parametrize(("dt_s", "expected"), [(1.0, 2901), (7.0, 414), (30.0, 97), (1000.0, 3), (5000.0, 1)])
def test_phases_are_whole_steps(dt_s: float, expected: int) -> None:
    """Half a period is 2900.6 s at 600 km; a step that does not divide it gets the nearest number of steps."""
    phase = Phase(formation=Following(), transfer_orbits=0.5, hold_orbits=0.5)
    scenario = Scenario(phases=(phase, phase), dt_s=dt_s, dropout={"kind": "none"})  # type: ignore[arg-type]
    half_period_s = 3.14159265 / mean_motion(scenario)
    assert abs(expected * dt_s - half_period_s) <= dt_s / 2
    assert scenario.steps(0.5) == expected
    assert scenario.num_steps == 4 * expected
    assert scenario.hold_s == 2 * expected * dt_s


def test_the_leader_is_like_the_follower_if_left_out() -> None:
    """Equal ballistic coefficients by default, as in the thesis."""
    scenario = load_scenario("keeping")
    assert scenario.leader == scenario.spacecraft
    heavy = Spacecraft(mass_kg=1500.0)
    assert dataclasses.replace(scenario, leader_spacecraft=heavy).leader == heavy


@pytest.mark.parametrize("name", ["keeping", "FormationKeeping-v0"])
@pytest.mark.parametrize("kind", ["file", "folder"])
def test_a_shipped_name_wins_over_what_lies_in_the_working_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, kind: str
) -> None:
    """A path is what ends in .yaml or .yml."""
    scenario = load_scenario("keeping")
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).mkdir() if kind == "folder" else (tmp_path / name).write_text("not a scenario")
    assert load_scenario(name) == scenario


def test_names_that_are_no_names() -> None:
    """Long, with a null character, with another ending: one line each."""
    for name, fault in (
        ("x" * 300, "no scenario named 'xxx"),
        ("x" * 300 + ".yaml", "cannot be read: File name too long"),
        ("a\0b", "no scenario named"),
        ("a\0b.yaml", "cannot be read: .* null"),
        ("mission.json", "a scenario file must end in .yaml or .yml"),
        ("somewhere/mission", "a scenario file must end in .yaml or .yml"),
    ):
        with pytest.raises(ConfigError, match=fault) as caught:
            load_scenario(name)
        assert len(str(caught.value).splitlines()) == 1


def test_an_unknown_name_names_its_nearest() -> None:
    """So does a name that resembles none: then all are listed."""
    with pytest.raises(ConfigError, match="no scenario named 'kepping'; did you mean 'keeping'"):
        load_scenario("kepping")
    with pytest.raises(ConfigError, match=r"known: bad_communication, .*, thesis_reconfiguration$"):
        load_scenario("zzz")
    with pytest.raises(ConfigError, match="did you mean 'mission'"):
        FormationEnv("misson")


def phase(text: str) -> str:
    return f"phases: [{{{text}}}]\n"


def dropout(text: str) -> str:
    return f"{PHASES}dropout: {{{text}}}\n"


FOLLOWING = "formation: {kind: following}"
# What is in the file, and what the one line of the error says after the file's name.
FAULTS = {
    "unknown key": (PHASES + "sensors: {}\n", "sensors: unknown key; did you mean 'sensor'?"),
    "unknown key like none": (PHASES + "zzz: 1\n", "zzz: unknown key; known: domain_randomization, dropout, .*"),
    "number as key": (PHASES + "3: 1\n", "3: unknown key; known: .*"),
    "nested key": (PHASES + "sensor: {sigma_pos: 1}\n", "sensor.sigma_pos: unknown key; did you mean 'sigma_pos_m'?"),
    "orbit's key": (PHASES + "orbit: {altitude: 1}\n", "orbit.altitude: unknown key; did you mean 'altitude_m'?"),
    "leader's key": (PHASES + "leader_spacecraft: {mass: 1}\n", "leader_spacecraft.mass: unknown key; .*'mass_kg'?"),
    "phase's key": (
        phase(f"{FOLLOWING}, hold_period: 1"),
        "phases.0.hold_period: unknown key; did you mean 'hold_orbits'?",
    ),
    "formation's key": (
        phase("formation: {kind: following, y_m: 1}, hold_orbits: 1"),
        "phases.0.formation.y_m: unknown key; did you mean 'y0_m'?",
    ),
    "window's key": (
        dropout("kind: windows, windows: [{start: 0, duration_s: 1}]"),
        "dropout.windows.0.start: unknown key; did you mean 'start_s'?",
    ),
    "word for number": (PHASES + "dt_s: ten\n", "dt_s: must be a valid number, got the string 'ten'"),
    "quoted exponent": (PHASES + 'dt_s: "1e-3"\n', "dt_s: must be a valid number, got the string '1e-3'"),
    "number with unit": (PHASES + "sensor: {sigma_pos_m: 2 m}\n", "sensor.sigma_pos_m: .* got the string '2 m'"),
    "bool for number": (PHASES + "dt_s: true\n", "dt_s: must be a valid number, got True"),
    "number for bool": (PHASES + "orbit: {j2: 1}\n", "orbit.j2: must be a valid boolean, got 1"),
    "yes for bool": (PHASES + "orbit: {j2: yes}\n", "orbit.j2: must be a valid boolean, got the string 'yes'"),
    "nothing for number": (PHASES + "dt_s:\n", "dt_s: must be a valid number, got None"),
    "list for number": (PHASES + "dt_s: [30]\n", "dt_s: must be a valid number, got [30]"),
    "date for number": (PHASES + "dt_s: 2020-12-15\n", "dt_s: must be a valid number, got 2020-12-15"),
    "number for text": (PHASES + "title: 3\n", "title: must be a valid string, got 3"),
    "nan": (PHASES + "dt_s: .nan\n", "dt_s: must be a finite number, got nan"),
    "inf": (PHASES + "limits: {max_distance_m: .inf}\n", "limits.max_distance_m: must be a finite number, got inf"),
    "overflow": (PHASES + "dt_s: 1e999\n", "dt_s: must be a finite number, got inf"),
    "negative sigma": (PHASES + "sensor: {sigma_pos_m: -1}\n", "sensor.sigma_pos_m: must be .* equal to 0, got -1"),
    "negative belief": (PHASES + "filter: {sigma_pos_m: -1}\n", "filter.sigma_pos_m: must be .* equal to 0, got -1"),
    "no time step": (PHASES + "dt_s: 0\n", "dt_s: must be greater than 0, got 0"),
    "underground": (PHASES + "orbit: {altitude_m: 600}\n", "orbit.altitude_m: must be .* 100000, got 600"),
    "inclination": (PHASES + "orbit: {inclination_deg: 181}\n", "orbit.inclination_deg: must be .* 180, got 181"),
    "no phases": ("dt_s: 30\n", "phases: required but missing"),
    "empty phases": ("phases: []\n", "phases: must have at least one phase, got []"),
    "phases as mapping": ("phases: {hold_orbits: 1}\n", "phases: must be a list, got {'hold_orbits': 1}"),
    "phase as number": ("phases: [3]\n", "phases.0: must be a mapping, got 3"),
    "no hold": (phase(FOLLOWING), "phases.0.hold_orbits: required but missing"),
    "no formation": (phase("hold_orbits: 1"), "phases.0.formation: required but missing"),
    "hold of zero": (phase(f"{FOLLOWING}, hold_orbits: 0"), "phases.0.hold_orbits: must be greater than 0, got 0"),
    "transfer backwards": (
        phase(f"{FOLLOWING}, hold_orbits: 1, transfer_orbits: -1"),
        "phases.0.transfer_orbits: must be greater than or equal to 0, got -1",
    ),
    "unknown formation": (
        phase("formation: {kind: folowing}, hold_orbits: 1"),
        "phases.0.formation.kind: unknown kind 'folowing'; did you mean 'following'?",
    ),
    "formation without kind": (
        phase("formation: {y0_m: 1}, hold_orbits: 1"),
        "phases.0.formation.kind: missing; known: at_leader, following, .*",
    ),
    "formation as word": (
        phase("formation: following, hold_orbits: 1"),
        "phases.0.formation: must be a mapping with a kind (at_leader, .*), got the string 'following'",
    ),
    "unknown start": (
        PHASES + "start: {formation: {kind: leader}}\n",
        "start.formation.kind: unknown kind 'leader'; did you mean 'at_leader'?",
    ),
    "unknown dropout": (
        dropout("kind: gilbert"),
        "dropout.kind: unknown kind 'gilbert'; did you mean 'gilbert_elliott'?",
    ),
    "dropout as word": (
        PHASES + "dropout: none\n",
        "dropout: must be a mapping with a kind (.*), got the string 'none'",
    ),
    "probability": (
        dropout("kind: bernoulli, loss_probability: 1.5"),
        "dropout.loss_probability: must be less than or equal to 1, got 1.5",
    ),
    "negative window": (
        dropout("kind: windows, windows: [{start_s: 0, duration_s: 9}, {start_s: -1, duration_s: 9}]"),
        "dropout.windows.1.start_s: must be greater than or equal to 0, got -1",
    ),
    "window backwards": (
        dropout("kind: windows, windows: [{start_s: 0, duration_s: -9}]"),
        "dropout.windows.0.duration_s: must be greater than 0, got -9",
    ),
    "window as mapping": (
        dropout("kind: windows, windows: {start_s: 0, duration_s: 9}"),
        "dropout.windows: must be a list, got {'start_s': 0, 'duration_s': 9}",
    ),
    "outage below the step": (
        dropout("kind: gilbert_elliott, mean_outage_s: 10"),
        "dropout.mean_outage_s: a mean of 10 s is shorter than the step dt_s = 30 s",
    ),
    "outages too often": (
        dropout("kind: gilbert_elliott, mean_uptime_orbits: 0.001"),
        "dropout.mean_uptime_orbits: a mean of 5.80.* s is shorter than the step dt_s = 30 s",
    ),
    "unknown dynamics": (
        PHASES + "dynamics: modified_hwc\n",
        "dynamics: no dynamics model named 'modified_hwc'; did you mean 'modified_hcw'?",
    ),
    "unknown belief": (
        PHASES + "filter: {dynamics: hwc}\n",
        "filter.dynamics: no dynamics model named 'hwc'; did you mean 'hcw'?",
    ),
    "hold below a step": (
        phase(f"{FOLLOWING}, hold_orbits: 0.001"),
        "phases.0.hold_orbits: 0.001 periods are 5.801 s, which rounds to no step of dt_s = 30 s",
    ),
    "transfer below a step": (
        phase(f"{FOLLOWING}, hold_orbits: 1}}, {{{FOLLOWING}, transfer_orbits: 0.001, hold_orbits: 1"),
        "phases.1.transfer_orbits: 0.001 periods are 5.801 s, which rounds to no step of dt_s = 30 s",
    ),
    "too many steps": (PHASES + "dt_s: 0.001\n", "dt_s: 5801231 steps of 0.001 s; an episode has at most 1000000"),
    "endless hold": (phase(f"{FOLLOWING}, hold_orbits: 1e306"), "dt_s: .* steps of 30 s; an episode has at most .*"),
    "too much memory": (
        phase(f"{FOLLOWING}, hold_orbits: 10") + "dynamics: nonlinear\ndt_s: 0.06\n",
        "dt_s: tables of 966872 steps in all take about 4.45 GB; at most 2 GB, 434782 steps of this scenario",
    ),
    "dead thruster": (
        PHASES + "spacecraft: {min_accel_m_s2: 1}\n",
        "spacecraft.min_accel_m_s2: must not be above the greatest thrust, 0.1732, got 1",
    ),
    "start in the keep-out sphere": (
        PHASES + "limits: {keep_out_m: 10}\n",
        "start.formation: 0 m from the leader, inside limits.keep_out_m = 10 m",
    ),
    "start out of bounds": (
        PHASES + "limits: {max_distance_m: 1999}\n",
        "start.formation: 2000 m between the start and the phase's reference, beyond limits.max_distance_m = 1999 m",
    ),
    "unknown sensor": (PHASES + "sensor: {measures: speed}\n", "sensor.measures: must be .*, got the string 'speed'"),
    "unknown shape": (
        PHASES + "reward: {error_cost: cubic}\n",
        "reward.error_cost: must be 'linear' or 'quadratic', got the string 'cubic'",
    ),
    "list for mapping": (PHASES + "sensor: [1, 2]\n", "sensor: must be a mapping, got [1, 2]"),
    "file is a list": ("- 1\n", "(top level): must be a mapping, got [1]"),
    "file is a word": ("hello\n", "(top level): must be a mapping, got the string 'hello'"),
    "empty file": ("", "(top level): must be a mapping, got None"),
    "repeated key": (PHASES + "dt_s: 30\ndt_s: 20\n", 'line 3: no valid YAML: found duplicate key "dt_s" .*'),
    "broken YAML": ("phases: [{formation: \n", "line 2: no valid YAML: .*"),
    "tab": (PHASES + "\tdt_s: 3\n", "line 2: no valid YAML: found character '\\t' .*"),
    "two documents": (PHASES + "---\n" + PHASES, "line 2: no valid YAML: .*another document"),
    "unknown anchor": (PHASES + "sensor: *x\n", "line 2: no valid YAML: found undefined alias 'x'"),
    "code in YAML": (PHASES + "sensor: !!python/object:os.system {}\n", "line 2: no valid YAML: .* constructor .*"),
    "no such date": (PHASES + "dt_s: 2020-13-45\n", "line 2: no valid YAML: '2020-13-45' is no timestamp: .*"),
    "not UTF-8": (b"title: \xff\xe9\n", "no valid YAML: .*"),
    "control character": (PHASES + 'title: "\x01"\n', "no valid YAML: .*"),
}


@pytest.mark.parametrize(("text", "expected"), FAULTS.values(), ids=FAULTS.keys())
def test_a_faulty_file_is_refused_in_one_line(tmp_path: Path, text: str | bytes, expected: str) -> None:
    """The line names the file, the key, the fault and the value, and is no longer than anyone reads.

    In `expected`, `.*` stands for any text.
    """
    path = write(tmp_path, text)
    with pytest.raises(ConfigError) as caught:
        load_scenario(path)
    pattern = re.escape(expected).replace(r"\.\*", ".*")
    assert re.fullmatch(f"{re.escape(str(path))}: {pattern}", str(caught.value)), str(caught.value)
    assert len(str(caught.value)) < len(str(path)) + 400


def test_each_fault_of_a_file_has_its_line(tmp_path: Path) -> None:
    """Three wrong values are told at once."""
    path = write(tmp_path, PHASES + "dt_s: 0\nsensor: {sigma_pos_m: -1}\norbit: {j2: 3}\n")
    with pytest.raises(ConfigError) as caught:
        load_scenario(path)
    keys = [line.removeprefix(f"{path}: ").split(": ")[0] for line in str(caught.value).splitlines()]
    assert keys == ["orbit.j2", "sensor.sigma_pos_m", "dt_s"]


def test_a_path_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    """A missing file, and a folder with a file's name."""
    with pytest.raises(ConfigError, match=r"absent\.yaml: cannot be read: No such file"):
        load_scenario(tmp_path / "absent.yaml")
    (tmp_path / "folder.yaml").mkdir()
    with pytest.raises(ConfigError, match=r"folder\.yaml: cannot be read: Is a directory"):
        load_scenario(tmp_path / "folder.yaml")


def test_the_start_may_lie_just_within_the_limits() -> None:
    """At the limits' edge the first step does not end the episode, so the scenario stands."""
    hold = Phase(formation=Following(y0_m=2000.0), hold_orbits=1.0)
    assert Scenario(phases=(hold,), limits=Limits(max_distance_m=2000.0)).start.formation == AtLeader()
    circle = SpaceCircle()
    orbiting = Phase(formation=circle, hold_orbits=1.0)
    limits = Limits(keep_out_m=3900.0, max_distance_m=1.0)
    assert Scenario(phases=(orbiting,), start=Start(formation=circle), limits=limits).num_steps == 193
