"""Other packages' environments: measured where installed, named where not; stand-in packages, nothing downloaded."""

import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from formation_env.evaluation.rivals import RIVALS, Rival, Stepper, make_steppers, vbar_stepper

ABSENT = Rival(
    "no-such-package", "no_such_package", "task", "pip install no-such-package", 8, lambda rows: lambda: rows
)


def imported(rows: int) -> Stepper:
    """A stepper of a stand-in package that is really imported; a call takes three steps of all rows."""
    import far_away  # type: ignore[import-not-found, unused-ignore]

    steps: int = far_away.STEPS
    return lambda: steps * rows


INSTALLED = Rival("far-away", "far_away", "task", "pip install far-away", 4, imported)


def install(folder: Path, code: str) -> None:
    """Put a package and its version where Python looks for them."""
    (folder / "far_away.py").write_text(code, encoding="utf-8")
    record = folder / "far_away-1.2.3.dist-info"
    record.mkdir()
    (record / "METADATA").write_text("Metadata-Version: 2.1\nName: far-away\nVersion: 1.2.3\n", encoding="utf-8")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that is searched for modules; what is imported from it is forgotten."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "far_away", raising=False)
    return tmp_path


def test_what_is_not_installed_is_named() -> None:
    """An absent package costs its rows of the table and nothing else, and the line says how to get it."""
    groups, left_out = make_steppers(rivals=(ABSENT,))
    assert groups == {}
    assert left_out == ["no-such-package task: not installed; pip install no-such-package"]


def test_an_installed_package_is_stepped_with_its_version(folder: Path) -> None:
    """Each rival has its own rows unless they are given, and is found beside one that is absent."""
    install(folder, "STEPS = 3\n")
    groups, left_out = make_steppers(rivals=(ABSENT, INSTALLED))
    assert list(groups) == [4]
    assert list(groups[4]) == ["far-away 1.2.3 task"]
    assert groups[4]["far-away 1.2.3 task"]() == 12
    assert len(left_out) == 1
    assert list(make_steppers(16, (INSTALLED,))[0]) == [16]


def test_a_package_that_cannot_be_imported_is_left_out(folder: Path) -> None:
    """A dependency that a rival forgot to declare must not end our benchmark."""
    install(folder, "import no_such_dependency\n")
    groups, left_out = make_steppers(rivals=(INSTALLED,))
    assert groups == {}
    assert left_out == ["far-away task: No module named 'no_such_dependency'; pip install far-away"]


def test_no_rival_is_imported_before_it_is_stepped(monkeypatch: pytest.MonkeyPatch) -> None:
    """With every rival's import forbidden, looking for them raises nothing: all of them are left out."""
    for name in ("gymnax", "jax", "orbitalgym", "vbar"):
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setattr(Rival, "is_installed", lambda self: True)
    groups, left_out = make_steppers()
    assert groups == {}
    assert [line.split()[0] for line in left_out] == [rival.distribution for rival in RIVALS]


class Approach:
    """Stands in for vbar's batched environment; remembers the actions of its steps."""

    made: "Approach"

    def __init__(self, num_envs: int) -> None:
        self.rows = num_envs
        self.cfg = SimpleNamespace(max_steps=100)
        self.action_space = SimpleNamespace(seed=lambda seed: None, sample=iter(range(1000)).__next__)
        self.actions: list[Any] = []
        Approach.made = self

    def reset(self, seed: int) -> None:
        self.actions.clear()

    def step(self, action: Any) -> None:
        self.actions.append(action)


def test_vbar_flies_one_episode_of_all_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """The returned count is steps times rows; random actions are drawn before the clock runs."""
    scenarios = ModuleType("vbar.scenarios")
    scenarios.ApproachVectorEnv = Approach  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "vbar", ModuleType("vbar"))
    monkeypatch.setitem(sys.modules, "vbar.scenarios", scenarios)
    run = vbar_stepper(5)
    assert run() == 500
    assert Approach.made.rows == 5
    assert Approach.made.actions == [*range(64), *range(36)]


@pytest.mark.parametrize("rival", RIVALS, ids=lambda rival: rival.distribution)
def test_the_real_package_is_stepped_where_installed(rival: Rival) -> None:
    """Guards against changes of a rival's interface; skipped where that package is absent, as in development."""
    if not rival.is_installed():
        pytest.skip(rival.install)
    groups, left_out = make_steppers(8, (rival,))
    assert left_out == []
    (run,) = groups[8].values()
    assert run() >= 8 * 100
