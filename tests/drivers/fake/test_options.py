"""What the simulated grabber can be told."""

import dataclasses

import pytest

from grabberd_fake import FakeGrabber, FakeOptions
from grabberd_fake.faults import Lose, Unplug
from grabberd_fake.liner_options import EllipseOptions, LinerOptions, WaveOptions
from grabberd_fake.options import CameraOptions, PictureOptions, PointOption, RigOptions


def test_without_options_it_is_the_reference_rig_before_the_liner() -> None:
    options = FakeOptions.read({})
    assert options == FakeOptions()
    assert (options.scene, options.rig.reflections, options.pace) == ("liner", 2, "real")
    assert (options.rig.base_mm, options.rig.distance_mm, options.camera.f_mm) == (128.0, 240.0, 8.0)


def test_nested_mappings_become_a_tree_of_options() -> None:
    options = FakeOptions.read({"rig": {"reflections": 1}, "picture": {"noise": 0, "jitter_px": 0.2}})
    assert options.rig == RigOptions(reflections=1)
    assert options.picture == PictureOptions(noise=0.0, jitter_px=0.2)
    assert isinstance(options.picture.noise, float)


@pytest.mark.parametrize(
    ("values", "key", "said"),
    [
        ({"picture": {"noise": 2}}, "picture.noise", "2 is not a number from 0 to 0.5"),
        ({"picture": {"noise": "much"}}, "picture.noise", "'much' is not a number"),
        ({"picture": {"noise": True}}, "picture.noise", "True is not a number"),
        ({"picture": {"noise": float("nan")}}, "picture.noise", "nan is not a number"),
        ({"picture": {"stamp": 1}}, "picture.stamp", "1 is not one of True, False"),
        ({"buffers": 3.5}, "buffers", "3.5 is not a whole number from 2 to 32"),
        ({"scene": "teat"}, "scene", "'teat' is not one of liner, ellipse, calibration_frame"),
        ({"rig": {"reflections": 3}}, "rig.reflections", "3 is not one of 2, 1"),
        ({"rig": 5}, "rig", "5 is not a mapping"),
        ({"seed": -1}, "seed", "from 0 to"),
        ({"speed": 1}, "speed", "unknown key; known are scene,"),
        ({"liner": {"radius": 1}}, "liner.radius", "unknown key; known are wall,"),
        ({"faults": {"kind": "lose"}}, "faults", "is not a list"),
        ({"faults": [{"kind": "melt"}]}, "faults[0]", "has no 'kind' out of lose,"),
        ({"faults": [{"kind": "lose", "at_s": 1, "cuont": 2}]}, "faults[0].cuont", "unknown key"),
        ({"faults": [{"kind": "lose"}]}, "faults[0].at_s", "give either at_s or at_field"),
        ({"faults": [{"kind": "lose", "at_s": 1, "at_field": 1}]}, "faults[0].at_s", "give either"),
        ({"scene": "points", "points": [{"id": 1, "x_mm": 0, "y_mm": 0}]}, "points[0].z_mm", "missing"),
        ({"camera": {"radial": [0.0]}}, "camera.radial", "has not 3 numbers"),
        ({"camera": {"decentering": [0.0]}}, "camera.decentering", "has not 2 numbers"),
        ({"camera": {"radial": [0.0, 1.0, 0.0]}}, "camera.radial[1]", "from -0.01 to 0.01"),
        ({"ellipse": {"deflection_mm": 9}}, "ellipse.deflection_mm", "more than .7 of the radius 12.5"),
        ({"ellipse": {"open": 0.9}}, "ellipse.opening + open + closing", "more than the whole period"),
        ({"ellipse": {"columns": 13}}, "ellipse.columns", "do not fit round the wall"),
        ({"ellipse": {"rows": 22}}, "ellipse.rows", "longer than 130 mm"),
        ({"liner": {"wall": "cow"}}, "liner.wall", "'cow' is not one of reference-blunt, reference-empty,"),
        ({"liner": {"columns": 14}}, "liner.columns", "do not fit round the wall"),
        ({"liner": {"rows": 22}}, "liner.rows", "reach over the wall's end at ±65 mm"),
        ({"liner": {"patch_x_mm": 20}}, "liner.rows", "about 20 mm reach over the wall's end"),
        (
            {"liner": {"vacuum": {"open": 0.9}}},
            "liner.vacuum.rising + open + falling",
            "more than the whole period",
        ),
        ({"liner": {"vacuum": {"liner_kpa": 30}}}, "liner.vacuum.system_kpa", "no wall is solved for that"),
    ],
)
def test_what_cannot_be_used_is_refused_with_its_key_and_what_is_allowed(
    values: dict[str, object], key: str, said: str
) -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        FakeGrabber(**values)
    assert str(caught.value).startswith(f"{key}: ")
    assert said in str(caught.value)


def test_everything_that_is_wrong_is_said_at_once() -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        FakeOptions.read({"pace": "slow", "picture": {"noise": 9, "blur": 1}, "buffers": 0})
    keys = [line.split(":")[0] for line in str(caught.value).splitlines()]
    assert sorted(keys) == ["buffers", "pace", "picture.blur", "picture.noise"]


def test_two_points_of_one_id_are_refused() -> None:
    point = {"id": 4, "x_mm": 0, "y_mm": 0, "z_mm": 0}
    with pytest.raises(ValueError, match="points: an id is given twice"):
        FakeOptions.read({"scene": "points", "points": [point, point]})


def test_points_are_refused_where_another_scene_would_ignore_them() -> None:
    with pytest.raises(ValueError, match="points: given, but the scene is 'liner'"):
        FakeOptions.read({"points": [{"id": 4, "x_mm": 0, "y_mm": 0, "z_mm": 0}]})


def test_a_point_needs_a_direction() -> None:
    with pytest.raises(ValueError, match="nx, ny, nz: all zero"):
        FakeOptions.read({"scene": "points", "points": [{"id": 1, "x_mm": 0, "y_mm": 0, "z_mm": 0, "nz": 0}]})


def test_the_script_becomes_a_typed_entry_each() -> None:
    script = [
        {"at_s": 1.0, "kind": "lose", "count": 3},
        {"at_field": 80, "kind": "unplug", "back_after_s": 2},
    ]
    assert FakeOptions.read({"faults": script}).faults == (
        Lose(at_s=1.0, count=3),
        Unplug(at_field=80, back_after_s=2.0),
    )


def test_options_that_were_read_can_be_read_again() -> None:
    options = FakeOptions.read({"faults": [{"at_s": 1, "kind": "stall"}], "rig": {"seed": 4}})
    again = {item.name: getattr(options, item.name) for item in dataclasses.fields(options)}
    assert FakeOptions.read(again) == options


@pytest.mark.parametrize(
    "tree",
    [
        CameraOptions,
        RigOptions,
        PictureOptions,
        EllipseOptions,
        LinerOptions,
        WaveOptions,
        PointOption,
        FakeOptions,
    ],
)
def test_every_option_is_documented(tree: type) -> None:
    text = tree.__doc__ or ""
    undocumented = [item.name for item in dataclasses.fields(tree) if item.name not in text]
    assert undocumented in ([], ["id", "x_mm", "y_mm", "z_mm"])
