"""A long flight made short: its readings, its end, and where memory is read."""

import mmap
import sys
from pathlib import Path

import numpy as np
import pytest

from formation_env.evaluation import soak
from formation_env.evaluation.soak import Reading, fly, growth_mib, resident_mib
from formation_env.task.loading import load_scenario

SHORT = "phases: [{formation: {kind: following, y0_m: -100}, hold_orbits: 0.02}]\n"


def test_readings_reach_the_end_and_count_episodes(tmp_path: Path) -> None:
    """Whole steps of the batch, evenly spaced; every row ends once per episode when nobody leaves early."""
    path = tmp_path / "short.yaml"
    path.write_text(SHORT)
    scenario, done = load_scenario(path), []
    readings = list(fly(scenario, rows=3, steps=300 * scenario.num_steps, progress=done.append))
    assert [each.steps for each in readings] == [30 * k * scenario.num_steps for k in range(soak.READINGS + 1)]
    assert readings[-1].episodes == 300
    assert done == list(range(3, 300 * scenario.num_steps + 1, 3))


def test_fewer_steps_than_readings() -> None:
    """Three steps of one row: readings repeat, and the last has them all."""
    assert [each.steps for each in fly(load_scenario("keeping"), rows=2, steps=5)][-1] == 6


def test_a_value_that_is_not_finite_ends_the_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    """The environment is at fault then."""

    class Faulty(soak.FormationVectorEnv):
        def step(self, actions):
            observations, rewards, *others = super().step(actions)
            return observations, np.full_like(rewards, np.nan), *others

    monkeypatch.setattr(soak, "FormationVectorEnv", Faulty)
    with pytest.raises(RuntimeError, match="not finite"):
        next(fly(load_scenario("keeping"), rows=2, steps=5))


def test_memory_that_is_taken_is_seen() -> None:
    """64 MiB that are written to are resident."""
    before = resident_mib()
    assert before is not None
    pages = mmap.mmap(-1, 2**26)  # new ones; an array may lie where the process has freed memory before
    block = np.frombuffer(pages)
    block[:] = 1
    assert resident_mib() > before + 60
    assert block[-1] == 1


def test_memory_where_there_is_no_status_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The largest memory so far, of the same order, in its place; nothing where Python has no such module."""
    monkeypatch.setattr(soak, "_STATUS", tmp_path / "none")
    largest = resident_mib()
    assert largest is not None
    assert 10 < largest < 1e5
    monkeypatch.setitem(sys.modules, "resource", None)
    assert resident_mib() is None


def test_growth_needs_two_readings() -> None:
    """From the first to the last."""
    assert growth_mib([Reading(0, 0, 5.0), Reading(1, 0, 9.0), Reading(2, 0, 6.5)]) == 1.5
    assert growth_mib([Reading(0, 0, 5.0)]) is None
    assert growth_mib([Reading(0, 0, None), Reading(1, 0, None)]) is None
