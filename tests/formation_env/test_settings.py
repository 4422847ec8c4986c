"""The border: what settings accept, and what they say when they refuse."""

import dataclasses
import math
import pickle
import re
from pathlib import Path
from typing import Annotated, Any

import pytest

from formation_env.dropout import AnyDropout, Windows
from formation_env.formations import AnyFormation, Following, Parallel
from formation_env.settings import (
    MAX_FAULT_LINES,
    ConfigError,
    Flag,
    NonNegative,
    Positive,
    Probability,
    Real,
    Text,
    build,
    faults_of,
    load_yaml,
    nearest,
    settings,
)


@settings
class Lamp:
    """A settings class for these tests."""

    power_w: Positive = 1.0
    share: Probability = 0.5
    lit: Flag = True
    place_m: tuple[Real, Real, Real] = (0.0, 0.0, 0.0)


@settings
class Room:
    """A settings class with all kinds of fields."""

    name: Text
    area_m2: NonNegative = 0.0
    slope: Real = 0.0
    lamp: Lamp = Lamp()
    lamps: tuple[Lamp, ...] = ()
    formation: AnyFormation = Parallel()
    dropout: Annotated[AnyDropout, "any annotation"] = Windows()


KINDS = "at_leader, following, in_track, list, parallel, projected_circle, space_circle, train, xy_ellipse"


def test_builds_nested_settings() -> None:
    """Dicts, lists and scalars become frozen settings; whole numbers are numbers; what is left out has its default."""
    room = build(
        Room,
        {
            "name": "hall",
            "area_m2": 12,
            "lamp": {"place_m": [1, 2, 3.5]},
            "lamps": [{}, {"lit": False}],
            "formation": {"kind": "following", "y0_m": -5},
            "dropout": {"kind": "windows", "windows": [{"start_s": 1, "duration_s": 2}]},
        },
        "x.yaml",
    )
    assert room == Room(
        name="hall",
        area_m2=12.0,
        lamp=Lamp(place_m=(1.0, 2.0, 3.5)),
        lamps=(Lamp(), Lamp(lit=False)),
        formation=Following(y0_m=-5.0),
        dropout=Windows(windows=({"start_s": 1, "duration_s": 2},)),
    )
    assert type(room.area_m2) is float
    assert room.slope == 0


def test_settings_are_frozen_and_hashable() -> None:
    """They can be shared and compared, so nobody may change them."""
    lamp = Lamp(power_w=2.0)
    with pytest.raises(dataclasses.FrozenInstanceError):
        lamp.power_w = 3.0  # type: ignore[misc]
    assert len({lamp, Lamp(power_w=2.0), Lamp()}) == 2
    assert build(Room, {"name": "", "formation": Following(y0_m=1.0)}, "x").formation == Following(y0_m=1.0)


@pytest.mark.parametrize(
    ("data", "fault"),
    [
        ({"nane": 1}, "nane: unknown key; did you mean 'name'?"),
        ({3: 1}, "3: unknown key; known: area_m2, dropout, formation, lamp, lamps, name, slope"),
        ({}, "name: required but missing"),
        (None, "(top level): must be a mapping, got None"),
        ([1], "(top level): must be a mapping, got [1]"),
        ({"name": 5}, "name: must be a valid string, got 5"),
        ({"name": None}, "name: must be a valid string, got None"),
        ({"slope": "1e-3"}, "slope: must be a valid number, got the string '1e-3'"),
        ({"slope": True}, "slope: must be a valid number, got True"),
        ({"slope": [1.0]}, "slope: must be a valid number, got [1.0]"),
        ({"slope": math.nan}, "slope: must be a finite number, got nan"),
        ({"slope": -math.inf}, "slope: must be a finite number, got -inf"),
        ({"area_m2": -1}, "area_m2: must be greater than or equal to 0, got -1"),
        ({"lamp": 5}, "lamp: must be a mapping, got 5"),
        ({"lamp": {"power_w": 0}}, "lamp.power_w: must be greater than 0, got 0"),
        ({"lamp": {"power": 1}}, "lamp.power: unknown key; did you mean 'power_w'?"),
        ({"lamp": {"lit": 1}}, "lamp.lit: must be a valid boolean, got 1"),
        ({"lamp": {"lit": "yes"}}, "lamp.lit: must be a valid boolean, got the string 'yes'"),
        ({"lamp": {"place_m": [1, 2]}}, "lamp.place_m.2: required but missing"),
        ({"lamp": {"place_m": [1, 2, "3"]}}, "lamp.place_m.2: must be a valid number, got the string '3'"),
        ({"lamps": {"power_w": 1}}, "lamps: must be a list, got {'power_w': 1}"),
        ({"lamps": [{}, {"share": 1.5}]}, "lamps.1.share: must be less than or equal to 1, got 1.5"),
        ({"lamps": [{}, {"shares": 1}]}, "lamps.1.shares: unknown key; did you mean 'share'?"),
        ({"formation": {"kind": "paralel"}}, "formation.kind: unknown kind 'paralel'; did you mean 'parallel'?"),
        ({"formation": {"kind": "zzz"}}, f"formation.kind: unknown kind 'zzz'; known: {KINDS}"),
        ({"formation": {"kind": [1]}}, f"formation.kind: unknown kind [1]; known: {KINDS}"),
        ({"formation": {"x0_m": 1}}, f"formation.kind: missing; known: {KINDS}"),
        ({"formation": None}, f"formation: must be a mapping with a kind ({KINDS}), got None"),
        ({"formation": "parallel"}, f"formation: must be a mapping with a kind ({KINDS}), got the string 'parallel'"),
        ({"formation": {"kind": "parallel", "y0_m": 1}}, "formation.y0_m: unknown key; did you mean 'x0_m'?"),
        (
            {"formation": {"kind": "parallel", "x0_m": "1"}},
            "formation.x0_m: must be a valid number, got the string '1'",
        ),
        (
            {"dropout": {"kind": "windows", "windows": [{"start_s": 0, "duration_s": -1}]}},
            "dropout.windows.0.duration_s: must be greater than 0, got -1",
        ),
        (
            {"dropout": {"kind": "windows", "windows": [{"start_s": 0}]}},
            "dropout.windows.0.duration_s: required but missing",
        ),
    ],
)
def test_faults_are_one_line_with_file_key_and_value(data: Any, fault: str) -> None:
    """Rule 8: plain and located; an unknown key or kind names its nearest neighbour, or all there are."""
    if isinstance(data, dict) and data and "name" not in data and "nane" not in data:
        data = {"name": "hall", **data}
    with pytest.raises(ConfigError) as caught:
        build(Room, data, "configs/x.yaml")
    assert str(caught.value) == f"configs/x.yaml: {fault}"


def test_every_fault_has_its_line() -> None:
    """All wrong values at once, each on its own line with the file's name."""
    with pytest.raises(ConfigError) as caught:
        build(Room, {"name": 1, "area_m2": -1, "lamp": {"share": 2}}, "x.yaml")
    lines = str(caught.value).splitlines()
    assert [line.split(": ")[:2] for line in lines] == [["x.yaml", key] for key in ("name", "area_m2", "lamp.share")]


def test_long_and_many_lined_values_stay_one_short_line() -> None:
    """Whatever was given, the message can be read."""
    with pytest.raises(ConfigError) as caught:
        build(Room, {"name": "", "slope": "first\nsecond" * 1000}, "x.yaml")
    assert len(str(caught.value).splitlines()) == 1
    assert len(str(caught.value)) < 200


def yaml_file(folder: Path, text: str) -> Path:
    path = folder / "x.yaml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 1e-3),
        ("1E5", 1e5),
        ("-2.5e+3", -2500.0),
        ("'1e-3'", "1e-3"),
        ("7", 7),
        ("true", True),
        ("yes", "yes"),
        ("12:30", "12:30"),
    ],
)
def test_yaml_scalars(tmp_path: Path, text: str, value: object) -> None:
    """YAML 1.2: bare 1e-3 is a number and quoted a string; `yes` is no flag, and a clock no number."""
    loaded = load_yaml(yaml_file(tmp_path, f"key: {text}"))["key"]
    assert loaded == value
    assert type(loaded) is type(value)


def test_a_bare_exponent_passes_and_a_quoted_one_is_refused(tmp_path: Path) -> None:
    """From the file to the settings: never read a number out of a string."""
    assert build(Room, load_yaml(yaml_file(tmp_path, "name: a\nslope: 1e-3")), "x").slope == 1e-3
    with pytest.raises(ConfigError, match=r"^x: slope: .* got the string '1e-3'$"):
        build(Room, load_yaml(yaml_file(tmp_path, "name: a\nslope: '1e-3'")), "x")


@pytest.mark.parametrize("text", [".nan", ".inf", "-.INF"])
def test_yaml_numbers_that_are_not_finite_are_refused(tmp_path: Path, text: str) -> None:
    """YAML knows them; no setting does."""
    with pytest.raises(ConfigError, match=r"^x: slope: must be a finite number"):
        build(Room, load_yaml(yaml_file(tmp_path, f"name: a\nslope: {text}")), "x")


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("a: 1\nb: 2\na: 3", 'line 3: no valid YAML: found duplicate key "a" with value "3" (original value: "1")'),
        ("a: [1", "line 1: no valid YAML: expected ',' or ']', but got '<stream end>'"),
        ("a: 1\n\tb: 2", "line 2: no valid YAML: found character '\\t' that cannot start any token"),
        ("a: *b", "line 1: no valid YAML: found undefined alias 'b'"),
        ("a: 1\n---\na: 2", "line 2: no valid YAML: but found another document"),
        ("a: 2020-13-45", "line 1: no valid YAML: '2020-13-45' is no timestamp: month must be in 1..12"),
    ],
)
def test_broken_yaml(tmp_path: Path, text: str, fault: str) -> None:
    """One line: the file, the line in it, what is wrong."""
    path = yaml_file(tmp_path, text)
    with pytest.raises(ConfigError) as caught:
        load_yaml(path)
    assert str(caught.value) == f"{path}: {fault}"


def test_yaml_runs_no_code(tmp_path: Path) -> None:
    """A tag that asks for a Python object is refused."""
    with pytest.raises(ConfigError, match="could not determine a constructor"):
        load_yaml(yaml_file(tmp_path, "a: !!python/object/apply:os.getcwd []"))


def test_bytes_that_are_no_text(tmp_path: Path) -> None:
    """A binary file is refused in one line."""
    (tmp_path / "x.yaml").write_bytes(b"a: \xff\xfe")
    with pytest.raises(ConfigError, match=r"x\.yaml: no valid YAML: [^\n]*$"):
        load_yaml(tmp_path / "x.yaml")


def test_missing_file_and_folder(tmp_path: Path) -> None:
    """What the operating system says, with the path."""
    with pytest.raises(ConfigError) as caught:
        load_yaml(tmp_path / "none.yaml")
    assert str(caught.value) == f"{tmp_path / 'none.yaml'}: cannot be read: No such file or directory"
    with pytest.raises(ConfigError, match="cannot be read"):
        load_yaml(tmp_path)


def test_nearest() -> None:
    """The closest known name, or all of them, sorted, when none is close."""
    assert nearest("following", ["parallel", "followin"]) == "did you mean 'followin'?"
    assert nearest("q", ["b", "a"]) == "known: a, b"


@pytest.mark.parametrize(
    ("make", "fault"),
    [
        (lambda: Lamp(power_w=-1.0), "Lamp: power_w: must be greater than 0, got -1.0"),
        (lambda: Lamp(lit=1), "Lamp: lit: must be a valid boolean, got 1"),
        (lambda: Lamp(power=1.0), r"Lamp: power: unknown key; did you mean 'power_w'\?"),
        (lambda: Room(), "Room: name: required but missing"),
        (lambda: Room(name="", lamp={"share": 2}), "Room: lamp.share: must be less than or equal to 1, got 2"),
        (lambda: Room(name="", formation={"kind": "paralel"}), "Room: formation.kind: unknown kind 'paralel'; did .*"),
        (lambda: Room(name="", formation=Windows()), r"Room: formation: must be a mapping with a kind \(.*\), got W.*"),
        (lambda: Room(name="", slope=10**400), "Room: slope: must be a .*, got an integer of 1329 bits"),
        (lambda: dataclasses.replace(Lamp(), share=2.0), "Lamp: share: must be less than or equal to 1, got 2.0"),
        (lambda: Parallel(x0_m="1"), "Parallel: x0_m: must be a valid number, got the string '1'"),
    ],
    ids=range(10),
)
def test_constructors_say_what_files_say(make: Any, fault: str) -> None:
    """One line per fault, with the class in the file's place, and no word of pydantic."""
    with pytest.raises(ConfigError) as caught:
        make()
    assert re.fullmatch(fault, str(caught.value)), str(caught.value)
    assert caught.value.__suppress_context__
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_of_many_faults_the_first_are_named() -> None:
    """6000 bad windows: a screenful, and how many more there are."""
    windows = [{"start_s": -1, "duration_s": 1}] * 6000
    with pytest.raises(ConfigError) as caught:
        build(Room, {"name": "", "dropout": {"kind": "windows", "windows": windows}}, "x.yaml")
    lines = str(caught.value).splitlines()
    assert len(lines) == MAX_FAULT_LINES + 1
    assert lines[0] == "x.yaml: dropout.windows.0.start_s: must be greater than or equal to 0, got -1"
    assert lines[-1] == f"x.yaml: and {6000 - MAX_FAULT_LINES} more faults"


def test_aliased_values_are_cut_before_they_are_written_out() -> None:
    """Thirty doublings of a list would fill the memory when written out."""
    value: list[Any] = [1, 2]
    for _ in range(30):
        value = [value, value]
    with pytest.raises(ConfigError) as caught:
        build(Room, {"name": "", "slope": value}, "x.yaml")
    assert str(caught.value).startswith("x.yaml: slope: must be a valid number, got [[[[...], [...]], [")
    assert len(str(caught.value)) < 150


def test_faults_without_their_place() -> None:
    """For errors about what several files or values led to."""
    with pytest.raises(ConfigError) as caught:
        Lamp(power_w=-1.0, share=2.0)
    assert faults_of(caught.value) == (
        "power_w: must be greater than 0, got -1.0; share: must be less than or equal to 1, got 2.0"
    )
