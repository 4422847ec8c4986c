"""The times of the stages: which there are, and that nothing is changed by repeating them."""

import inspect
import re

import numpy as np

from formation_env.kernel import program, stage_times
from formation_env.task.loading import load_scenario


def test_stages_are_those_of_the_step_in_its_order() -> None:
    """A stage that is added to the program, or moves in it, must be timed there, but for those that few ask for."""
    source = inspect.getsource(program._step).partition('"""Fly rows')[2]
    calls = re.findall(r"^ +(?:\w+ \+?= )?(?:\w+\.)?(\w+)\((?:state|streams|actions|work\d*)\b", source, re.MULTILINE)
    steps = [name for name in calls if name not in ("read_state", "innovate", "write_noises", "check_distance")]
    kinds = program.kinds_of(load_scenario("keeping_randomized"), 2)._replace(guarded=True)
    chosen = {
        "thrust": "thrust_ideal",
        "move": "fly_constant",
        "predict": "predict_constant",
        "sense": "sense_position_and_velocity",
        "measure": "measure_position_and_velocity",
    }
    assert len(steps) == 21
    timed = [name.rpartition(".")[2] for name in stage_times._calls(kinds)]
    assert timed == [chosen.get(name, name) for name in steps]


def test_times_are_finite_and_the_state_is_restored() -> None:
    """Every stage is called in a batch whose last tile is not full; the whole step takes some time."""
    times = stage_times.stage_times(load_scenario("keeping"), rows=65, rounds=1)
    assert list(times)[-1] == stage_times.WHOLE
    assert np.isfinite(list(times.values())).all()
    assert min(times.values()) >= 0
    assert times[stage_times.WHOLE] > 0
