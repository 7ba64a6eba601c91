"""Files as OpenPTV writes them, made here from a view by its own equations (trafo.h, imgcoord.h)."""

import os
from pathlib import Path

import numpy as np
import pytest

from grabberd.core.calibration.adjustment.network import matched
from grabberd.core.calibration.control_points import read_calibration_points
from grabberd.core.calibration.exchange import Sensor, read_orientation, read_targets
from grabberd.core.geometry import project, rotation_matrix
from grabberd.errors import InputError

SENSOR = Sensor(1280, 1024, (0.012, 0.01))
CENTER, ANGLES = np.array([78.1, 15.9, 470.8]), (-0.05, 0.16, 0.02)
PLACES = np.random.default_rng(1).uniform([-40, -25, -8], [40, 25, 8], (30, 3))
ADDED = "-2e-4 1e-6 0 3e-5 -4e-5 1.0 0.0"


def orientation(xh=0.0, yh=0.0):
    """Centre and angles, the matrix from camera to object, principal point and distance, glass."""
    rows = "\n".join(" ".join(f"{value:.12f}" for value in row) for row in rotation_matrix(*ANGLES).T)
    centre = " ".join(map(str, CENTER))
    return f"{centre}\n  {ANGLES[0]} {ANGLES[1]} {ANGLES[2]}\n\n{rows}\n\n {xh} {yh}\n 70.0\n\n 0 0 -125\n"


def by_openptv(places, xh=0.0, yh=0.0):
    """Pixels from the corner: perspective, shift, distortion about the sensor's middle, pitch."""
    camera = (places - CENTER) @ rotation_matrix(*ANGLES).T
    x, y = (-70.0 * camera[:, :2] / camera[:, 2:]).T
    x, y = x + xh, y + yh
    k1, k2, k3, p1, p2, *_ = map(float, ADDED.split())
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    far_x = x * radial + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y
    far_y = y * radial + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y
    return np.column_stack([640 + far_x / 0.012, 512 - far_y / 0.01])


def test_a_view_shows_points_where_openptv_shows_them():
    view = read_orientation("cam1", orientation(), ADDED, SENSOR)
    assert np.abs(project(view, PLACES) + 0.5 - by_openptv(PLACES)).max() < 1e-6
    assert np.allclose(view.axes, rotation_matrix(*ANGLES))


def test_a_principal_point_beside_the_middle_is_right_to_first_order():
    view = read_orientation("cam1", orientation(0.2, -0.1), ADDED, SENSOR)
    assert np.abs(project(view, PLACES) + 0.5 - by_openptv(PLACES, 0.2, -0.1)).max() < 2.0


def test_without_added_parameters_there_is_no_distortion():
    assert not any(read_orientation("cam1", orientation(), "", SENSOR).b)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1 2 3", "orientation cam1: expected 18 numbers"),
        (orientation().replace("70.0", "-70.0"), "principal distance of orientation cam1 is -70.0"),
        ("0 0 0 0 0 0  2 0 0 0 1 0 0 0 1  0 0 70 0 0 1", "is no rotation"),
        ("0 0 0 0 .1 0  1 0 0 0 1 0 0 0 1  0 0 70 0 0 1", "one rotation by its angles and another by its"),
        ("0 0 0 0 0 0  1 0 0 0 1 0 0 0 1  nan 0 70 0 0 1", "orientation cam1: nan is not a finite number"),
        (orientation() + "7", "orientation cam1: expected 18 numbers"),
    ],
)
def test_what_is_no_orientation_is_refused(text, said):
    with pytest.raises(InputError, match=said):
        read_orientation("cam1", text, "", SENSOR)


@pytest.mark.parametrize(
    ("added", "said"),
    [
        ("0 0 0 0 0 0 0", "the scale in x is 0"),
        ("0 0 0 0 0 1", "expected 7"),
        ("0 0 inf 0 0 1 0", "inf is not"),
    ],
)
def test_what_are_no_added_parameters_is_refused(added, said):
    with pytest.raises(InputError, match=f"added parameters cam1: {said}"):
        read_orientation("cam1", orientation(), added, SENSOR)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1.5\n 0 1 1 5 2 3 168 1\n", "line 1: the number of targets 1.5 is not a whole number"),
        ("1\n 0 nan 1 5 2 3 168 1\n", "line 2: nan is not a finite number"),
        ("1\n 0 1 1 5 2 3 168 1.5\n", "line 2: calibration point 1.5 is not a whole number"),
        ("2\n 0 1 1 5 2 3 168 1\n 0 9 9 5 2 3 168 2\n", "line 3: target 0 is given in line 2 already"),
        (
            "2\n 0 1 1 5 2 3 168 4\n 1 9 9 5 2 3 168 4\n",
            "line 3: calibration point 4 is given in line 2 already",
        ),
    ],
)
def test_what_targets_cannot_mean_is_refused_by_line(text, said):
    with pytest.raises(InputError, match=f"file of targets, {said}"):
        read_targets(text)


def test_targets_and_calibration_points_are_read():
    assigned, xy_px = read_targets("2\n 0 818.8393 3.5476 5 2 3 168 456\n 1 282.5938 4.1437 5 3 2 160 -1\n")
    assert assigned.tolist() == [456, -1]
    assert np.allclose(xy_px, [[818.3393, 3.0476], [282.0938, 3.6437]])
    ids, xyz_mm = read_calibration_points("1\t-40\t-25\t8\n\n2 -40 0 -8\n")
    assert ids.tolist() == [1, 2]
    assert xyz_mm.tolist() == [[-40, -25, 8], [-40, 0, -8]]
    with pytest.raises(InputError, match="holds 1 lines and states 2"):
        read_targets("2\n 0 818.8 3.5 5 2 3 168 456\n")


def test_known_points_are_paired_with_the_image_points_nearest_to_them():
    expected = np.array([[0.0, 0.0], [10.0, 0.0], [50.0, 0.0], [np.nan, np.nan]])
    known, image = matched(expected, np.array([[9.0, 1.0], [0.5, 0.0], [11.0, 3.0]]), 5.0)
    assert (known.tolist(), image.tolist()) == ([0, 1], [1, 0])


@pytest.mark.skipif("CAVITY" not in os.environ, reason="CAVITY names no copy of OpenPTV's test_cavity")
def test_the_script_of_the_manual_calibrates_the_four_cameras_of_the_cavity(monkeypatch):
    text = (Path(__file__).parents[4] / "docs/howto/networks.md").read_text("utf-8")
    script = text.split("```python\n")[3].split("```")[0]
    assert len(script.splitlines()) <= 25
    monkeypatch.chdir(os.environ["CAVITY"])
    names: dict = {}
    exec(script, names)
    assert [count for _, count, _ in names["found"]] == [43, 43, 71, 71]
    assert [sigma0 for *_, sigma0 in names["found"]] == pytest.approx([0.489, 0.347, 0.383, 0.376], abs=0.002)
