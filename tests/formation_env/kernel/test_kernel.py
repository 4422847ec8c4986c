"""The compiled program: what it is made of, and how its settings get into it."""

import ast
import dataclasses
import shutil
from collections.abc import Iterator
from pathlib import Path

import numba
import numpy as np
import pytest
from env_helpers import assert_same, random_actions

import formation_env
from formation_env import FormationVectorEnv, load_scenario, scenario_names
from formation_env.dynamics import NONLINEAR
from formation_env.kernel import packing, program, tile
from formation_env.kernel import settings as line
from formation_env.kernel.simulation import Simulation
from formation_env.kernel.stages.memory import LARGE_TILES
from formation_env.navigation.filter_settings import KalmanFilter
from formation_env.numerics.jit import LANES
from formation_env.numerics.streaming import LINE_BYTES
from formation_env.task.observation import SIZE

PACKAGE = Path(formation_env.__file__).parent
TREES = {
    path.relative_to(PACKAGE).with_suffix("").as_posix(): ast.parse(path.read_text(encoding="utf-8"))
    for path in PACKAGE.rglob("*.py")
}


@numba.njit
def read_all(settings):  # type: ignore[no-untyped-def]
    """All tuples of a line of settings, in the order in which `pack` writes them."""
    return (
        line.model(settings, line.TRUTH, 0),
        line.model(settings, line.FILTER, 0),
        line.process_noise(settings, line.FILTER, 0),
        line.forces(settings, 0),
        line.scalars(settings, 0),
    )


@pytest.mark.parametrize("name", scenario_names())
def test_the_step_reads_what_pack_wrote(name: str) -> None:
    """The same numbers in the same named places, for every element."""
    filter_model = KalmanFilter(dynamics="hcw", sigma_pos_m=3.0, process_noise_m_s2=1e-4)
    scenario = dataclasses.replace(load_scenario(name), filter=filter_model)
    settings = packing.pack(scenario)
    groups = read_all(settings[None])
    own = np.repeat(settings, LANES)
    assert read_all(own) == groups  # a row's own line gives the same
    flat = np.concatenate([np.ravel(values) for group in groups for values in group])
    np.testing.assert_array_equal(flat, settings)
    truth, believed, _, _, scalars = groups
    models = [(believed, scenario.filter_dynamics())]
    if scenario.dynamics != NONLINEAR:
        models.append((truth, scenario.true_dynamics()))
    for model, expected in models:
        Phi, Gamma = np.zeros((6, 6)), np.zeros((6, 3))
        Phi[np.ix_([0, 1, 3, 4], [0, 1, 3, 4])] = np.reshape(model.Phi_in_plane, (4, 4))
        Phi[np.ix_([2, 5], [2, 5])] = np.reshape(model.Phi_cross_track, (2, 2))
        Gamma[np.ix_([0, 1, 3, 4], [0, 1])] = np.reshape(model.Gamma_in_plane, (4, 2))
        Gamma[[2, 5], 2] = model.Gamma_cross_track
        np.testing.assert_array_equal(Phi, expected.Phi)
        np.testing.assert_array_equal(Gamma, expected.Gamma)
    assert (scalars.filter_variance_pos, scalars.filter_variance_vel) == (9.0, scenario.sensor.sigma_vel_m_s**2)
    assert scalars._asdict() == packing._scalars(scenario)._asdict()
    assert scalars.dt_s == scenario.dt_s
    assert scalars.num_steps == scenario.num_steps
    assert scalars.max_accel == scenario.spacecraft.max_accel_m_s2


@pytest.mark.parametrize("layout", ["State", "Work", "Work32", "Results", "Flags", "Integers", "Noises"])
def test_fields_of_a_layout_do_not_overlap(layout: str) -> None:
    """Each field begins where the one before ends, in lanes or in lines of a block."""
    sizes, offsets = getattr(tile, layout)(), getattr(tile, layout.upper())
    unit = LANES if layout in ("State", "Work", "Work32") else 1
    assert offsets[0] == 0
    for (name, offset), size, behind in zip(offsets._asdict().items(), sizes, offsets[1:], strict=False):
        assert offset + size * unit == behind, name


def test_results_stand_in_the_order_in_which_they_are_written() -> None:
    """`write_results` copies runs of fields: state and estimate from the state, the rest from scratch space."""
    fields = tile.Results._fields
    assert fields[:2] == tile.State._fields[:2]
    begin = tile.Work._fields.index(fields[2])
    assert fields[2:] == tile.Work._fields[begin : begin + len(fields) - 2]
    assert tile.Noises._fields[:2] == ("measurement", "innovation")
    begin = tile.Work._fields.index("measurement")
    assert tile.Work._fields[begin : begin + 2] == ("measurement", "innovation")


def test_rows_of_the_padding_do_not_show() -> None:
    """A batch that does not fill its last tile has as many rows as were asked for, everywhere."""
    env = FormationVectorEnv(33)
    env.reset(seed=0)
    outputs = env.step(random_actions(0, 33))
    assert [len(output) for output in outputs[:4]] == [33] * 4
    assert all(len(value) == 33 for value in outputs[4].values())


def imported_modules(tree: ast.AST) -> dict[str, str]:
    """Name in the file: module of this package that it comes from."""
    names: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("formation_env"):
            folder = node.module.removeprefix("formation_env").lstrip(".").replace(".", "/")
            for alias in node.names:
                inner = f"{folder}/{alias.name}".lstrip("/")
                names[alias.asname or alias.name] = inner if inner in TREES else folder
    return names


def is_compiled(function: ast.FunctionDef) -> bool:
    """Whether numba compiles a function, by its decorator."""
    names = {node.id for item in function.decorator_list for node in ast.walk(item) if isinstance(node, ast.Name)}
    return bool(
        names & {"inline_scalar", "tile_function", "python_and_compiled", "compiled_program", "numba", "intrinsic"}
    )


def names_at_work(tree: ast.Module) -> Iterator[str]:
    """Names that compiled functions use in their bodies, and those that module constants are made of."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and is_compiled(node):
            used = [inner for statement in node.body for inner in ast.walk(statement)]
        elif isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None and node in tree.body:
            used = list(ast.walk(node.value))
        else:
            continue
        yield from (inner.id for inner in used if isinstance(inner, ast.Name))


def test_the_hash_covers_all_that_is_compiled() -> None:
    """A cached program that does not see a change would fly yesterday's physics.

    Covered must be: every file with a compiled function, and every file of which such a file uses a name in compiled
    functions or in its constants.
    """
    covered = {
        str(path.relative_to(PACKAGE).with_suffix(""))
        for pattern in program.COMPILED_SOURCES
        for path in PACKAGE.glob(pattern)
    }
    with_functions = {
        name
        for name, tree in TREES.items()
        if any(isinstance(node, ast.FunctionDef) and is_compiled(node) for node in ast.walk(tree))
    }
    assert {
        "kernel/stages/observe",
        "kernel/stages/noise",
        "kernel/kalman",
        "numerics/random_streams",
        "numerics/fastmath",
        "numerics/single_precision",
    } <= with_functions
    assert with_functions <= covered
    for name in with_functions:
        imports = imported_modules(TREES[name])
        needed = {imports[used] for used in names_at_work(TREES[name]) if used in imports}
        assert needed <= covered, f"{name} uses {needed - covered}"
    assert covered <= set(TREES)


SOURCES = (
    "kernel/tile",
    "kernel/stages/true_motion",
    "kernel/settings",
    "numerics/jit",
    "orbital/constants",
    "orbital/accelerations",
    "dynamics/nonlinear",
    "task/observation",
    "task/schedule",
)


@pytest.mark.parametrize("module", SOURCES)
def test_the_hash_changes_with_each_source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str) -> None:
    """One changed character in any of the files gives another key of the cache."""
    copy = tmp_path / "formation_env"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__", "*.nb?"))
    monkeypatch.setattr(program, "__file__", str(copy / "kernel" / "program.py"))
    before = program.source_hash()
    path = copy / f"{module}.py"
    path.write_text(path.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    assert program.source_hash() != before


def test_the_program_carries_the_hash_of_its_sources() -> None:
    """The key is what the sources on the disk give: an equal checkout finds the cache, another does not."""
    assert program.source_hash() == program.source_hash()
    assert len(program.source_hash()) == 64


def test_the_key_of_the_cache_is_the_same_in_each_process() -> None:
    """A program closes over functions, which are new in each process: its key holds names and a hash alone."""
    kinds = program.kinds_of(load_scenario("keeping"), 1)
    for function in program.dispatchers(kinds):
        assert function._cache._key == (function.py_func.__name__, kinds, program.source_hash())
    assert program.look_dispatcher()._cache._key == ("look", program.source_hash())


def test_reset_writes_the_rows_asked_for_only() -> None:
    """Rows are reset in groups of a tile's width; nothing but those asked for is written, nor past the array's end."""
    simulation = Simulation(load_scenario("keeping"), 40)
    guarded = np.full((44, SIZE), 7.0, np.float32)
    observations = guarded[:40]
    rows = np.array([0, 3, 31, 32, 39])
    for row in range(40):
        simulation.seed(row, np.random.default_rng(row))
    simulation.reset(rows, observations)
    others = np.setdiff1d(np.arange(44), rows)
    assert (guarded[others] == 7.0).all()
    assert np.isfinite(observations[rows]).all()
    assert not (observations[rows] == 7.0).any()


def test_read_takes_names_and_rows() -> None:
    """Results and states alike, of any rows in any order, as copies; a wrong name lists the right ones."""
    env = FormationVectorEnv(70)
    env.reset(seed=0)
    infos = env.step(random_actions(0, 70))[4]
    simulation, rows = env.simulation, np.array([69, 0, 33])
    for name, key in (("position_error", "position_error_m"), ("thrust", "accel_m_s2"), ("true_state", "true_state")):
        np.testing.assert_array_equal(simulation.read(name), infos[key])
        np.testing.assert_array_equal(simulation.read(name, rows), infos[key][rows])
        simulation.read(name)[...] = np.nan
        np.testing.assert_array_equal(simulation.read(name), infos[key])
    assert simulation.read("measured", rows, bool).dtype == bool
    assert simulation.read("covariance_in_plane", rows).shape == (3, 10)
    assert (simulation.read("step") == 1).all()
    with pytest.raises(KeyError, match=r"unknown name 'positon'; known: true_state, .*thrust"):
        simulation.read("positon")


def test_nobody_outside_the_kernel_knows_its_offsets() -> None:
    """The environments and all that is built on them read by name."""
    repository = PACKAGE.parent
    paths = [
        path for folder in ("formation_env", "baselines", "agents") for path in (repository / folder).rglob("*.py")
    ]
    outside = [path for path in paths if "formation_env/kernel" not in path.as_posix() and path.name != "jit.py"]
    assert len(outside) > 100
    text = {path: path.read_text(encoding="utf-8") for path in outside}
    assert not [path for path, source in text.items() if "LANES" in source or "kernel import tile" in source]


def test_reading_the_noises_changes_no_flight() -> None:
    """A simulation that writes its noises flies as one that does not; and they are what moved it."""
    env, untouched = FormationVectorEnv(70, analysis=True), FormationVectorEnv(70)
    env.reset(seed=0)
    untouched.reset(seed=0)
    for action in random_actions(1, 3, 70):
        before = env.simulation.read("estimate")
        outputs, others = env.step(action), untouched.step(action)
        infos = {name: value for name, value in outputs[4].items() if name in others[4]}
        assert_same((*outputs[:4], infos), others)
        noises = {name: outputs[4][name] for name in ("measurement", "innovation", "process_noise_m_s2")}
        assert all(np.isfinite(value).all() for value in noises.values())
        predicted = noises["measurement"] - noises["innovation"]
        assert 0 < np.abs(predicted - before)[:, :3].max() < 1e3


def test_a_large_batch_flies_as_a_small_one() -> None:
    """Batches beyond the cache are written in another way, their last tile as small ones are: the same bits."""
    tiles = LARGE_TILES + 1
    large, small = FormationVectorEnv(tiles * LANES - 27, num_threads=1), FormationVectorEnv(70)
    first = large.num_envs - small.num_envs
    for env, start in ((large, 0), (small, first)):
        env.reset(seed=start)
    actions = random_actions(1, 3, small.num_envs)
    for action in actions:
        wide = np.zeros((large.num_envs, 3), np.float32)
        wide[first:] = action
        one, other = large.step(wide), small.step(action)
        assert large.simulation.results.blocks[0].ctypes.data % LINE_BYTES == 0  # else it is written as others are
        for mine, its in zip(one[:4], other[:4], strict=True):
            np.testing.assert_array_equal(mine[first:], its)
        for name, value in other[4].items():
            np.testing.assert_array_equal(one[4][name][first:], value, err_msg=name)
