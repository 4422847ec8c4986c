"""Formations, dropouts and dynamics from outside the package, and the lists of what there is."""

import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from formation_env import ConfigError, FormationEnv, Scenario, load_scenario
from formation_env.dropout import DROPOUTS, Dropout, NoDropout, register_dropout
from formation_env.dropout.base import LinkChain
from formation_env.dynamics import DYNAMICS, HCW, register_dynamics
from formation_env.formations import FORMATIONS, Following, Formation, register_formation
from formation_env.orbital.orbit import Orbit
from formation_env.quantities import Coordinate, Duration
from formation_env.settings import settings
from formation_env.task.loading import kinds, scenario_schema
from formation_env.task.phases import Phase, Start

Array = NDArray[np.float64]


@settings
class CrossTrack(Formation):
    """Oscillation through the leader's orbit plane.

    Attributes:
        z0_m: amplitude, m.
    """

    kind: Literal["cross_track"] = "cross_track"
    z0_m: Coordinate = 500.0

    def state(self, orbit: Orbit, time_s: float = 0.0) -> Array:
        """LVLH state (6,), m and m/s."""
        return np.array([0, 0, self.z0_m, 0, 0, 0])


@settings
class FirstContact(Dropout):
    """No link before a time, then every second measurement lost.

    Attributes:
        start_s: time of the first contact, s.
    """

    kind: Literal["first_contact"] = "first_contact"
    start_s: Duration = 600.0

    def chain(self, dt_s: float, orbit: Orbit) -> LinkChain:
        """Independent losses of one half."""
        return LinkChain(fail=0.5, recover=0.5)

    def closed(self, times_s: Array) -> NDArray[np.bool_]:
        """Closed before the first contact."""
        return times_s < self.start_s


@pytest.fixture
def registered() -> Iterator[None]:
    """The kinds of this file are known, and forgotten afterwards."""
    register_formation(CrossTrack)
    register_dropout(FirstContact)
    register_dynamics("plain_hcw", HCW)
    yield
    del FORMATIONS["cross_track"], DROPOUTS["first_contact"], DYNAMICS["plain_hcw"]


TEXT = """
dynamics: plain_hcw
dropout: {kind: first_contact, start_s: 300}
start: {formation: {kind: cross_track, z0_m: 800}}
phases: [{formation: {kind: cross_track, z0_m: 800}, hold_orbits: 0.1}]
"""


@pytest.mark.usefixtures("registered")
def test_registered_kinds_are_flown_from_a_file(tmp_path: Path) -> None:
    """A YAML file names them as it names those of the package."""
    path = tmp_path / "own.yaml"
    path.write_text(TEXT)
    scenario = load_scenario(path)
    assert scenario.start.formation == CrossTrack(z0_m=800.0)
    env = FormationEnv(scenario)
    _, info = env.reset(seed=1)
    assert abs(info["true_state"][2] - 800) < 100
    measured = [bool(info["measured"])] + [bool(env.step(np.zeros(3))[4]["measured"]) for _ in range(15)]
    assert not any(measured[:10])  # 300 s are 10 steps
    with pytest.raises(ConfigError, match=r"start\.formation\.kind: unknown kind 'cross_trak'; did .* 'cross_track'\?"):
        Scenario(phases=scenario.phases, start={"formation": {"kind": "cross_trak"}})  # type: ignore[arg-type]


def test_instances_pass_without_registration() -> None:
    """In Python a class of one's own needs no name."""
    phase = Phase(formation=CrossTrack(), hold_orbits=0.1)
    scenario = Scenario(start=Start(formation=CrossTrack()), phases=(phase,), dropout=FirstContact(), dt_s=30.0)
    assert dataclasses.replace(scenario, dt_s=10.0).dropout == FirstContact()
    FormationEnv(scenario).reset(seed=1)
    assert "cross_track" not in kinds()["formation"]


def test_instances_that_cannot_be_flown_are_refused() -> None:
    """A formation without a finite state, and one that cannot be hashed."""

    class Nowhere(Formation):
        def state(self, orbit: Orbit, time_s: float = 0.0) -> Array:
            return np.full(6, np.nan)

    class Mutable(Nowhere):
        __hash__ = None  # type: ignore[assignment]

    phase = Phase(formation=Following(), hold_orbits=0.1)
    with pytest.raises(ConfigError, match=r"^Scenario: start\.formation: its state must be six finite numbers, got"):
        Scenario(start=Start(formation=Nowhere()), phases=(phase,))
    with pytest.raises(ConfigError, match=r"^Start: formation: must be hashable"):
        Start(formation=Mutable())


def test_registration_refuses_what_cannot_work() -> None:
    """A class of another kind of part, one without settings, a name that is taken."""

    class Bare(Formation):
        def state(self, orbit: Orbit, time_s: float = 0.0) -> Array:
            return np.zeros(6)

    @settings
    class Ahead(CrossTrack):
        kind: Literal["following"] = "following"  # type: ignore[assignment]

    with pytest.raises(ValueError, match="NoDropout: must inherit from Formation"):
        register_formation(NoDropout)  # type: ignore[type-var]
    with pytest.raises(ValueError, match=r"Bare: must be made with @settings and have a field kind"):
        register_formation(Bare)
    with pytest.raises(ValueError, match=r"Ahead: kind 'following' is taken by .*\.Following"):
        register_formation(Ahead)
    with pytest.raises(ValueError, match="named 'hcw' exists already"):
        register_dynamics("hcw", DYNAMICS["modified_hcw"])
    with pytest.raises(ValueError, match="named 'nonlinear' exists already"):
        register_dynamics("nonlinear", HCW)
    assert register_formation(Following) is Following  # once more is no fault


@pytest.mark.usefixtures("registered")
def test_kinds_are_listed_with_keys_defaults_and_meanings() -> None:
    """For `formation-env env kinds`; registered ones included."""
    listed = kinds()
    assert set(listed) == {"formation", "dropout", "dynamics"}
    assert listed["formation"]["cross_track"] == {"z0_m": "number, default 500.0: amplitude, m."}
    assert listed["formation"]["at_leader"] == {}
    assert listed["dropout"]["windows"]["windows"].startswith("array, default [{'start_s': 0.0, 'duration_s': 3000.0}]")
    assert {"hcw", "nonlinear", "plain_hcw"} <= set(listed["dynamics"])
    for group, classes in (("formation", FORMATIONS), ("dropout", DROPOUTS)):
        for kind, cls in classes.items():
            assert {"kind", *listed[group][kind]} == {field.name for field in dataclasses.fields(cls)}
            assert all(": " in text for text in listed[group][kind].values()), "each key has its meaning"


@pytest.mark.usefixtures("registered")
def test_the_schema_knows_keys_bounds_and_meanings() -> None:
    """For editors: every key of a scenario with its description, and every registered kind."""
    schema = scenario_schema()
    json.dumps(schema, allow_nan=False)
    assert set(schema["properties"]) == {field.name for field in dataclasses.fields(Scenario)}
    assert all(entry.get("description") for entry in schema["properties"].values())
    assert schema["additionalProperties"] is False
    assert schema["required"] == ["phases"]
    assert "nonlinear" in schema["properties"]["dynamics"]["enum"]
    assert schema["$defs"]["CrossTrack"]["required"] == ["kind"]
    assert schema["$defs"]["Spacecraft"]["properties"]["max_accel_m_s2"]["maximum"] == 1000
