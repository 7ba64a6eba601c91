"""Lists of known points: read where they can be read in one way, and refused by line where they cannot."""

import pytest

from grabberd.core.calibration.control_points import (
    ControlPoint,
    read_calibration_points,
    read_control_points,
)
from grabberd.errors import InputError

PLACE = (100.0, 200.0, 50.0)


def first(text):
    return next(iter(read_control_points(text).values()))


@pytest.mark.parametrize(
    ("given", "sigma_mm"),
    [
        ("", (0, 0, 0)),
        (",1e-3", (1, 1, 1)),
        (", 1e-3, 2e-3", (1, 1, 2)),
        (",1e-3,2e-3,3e-3", (1, 2, 3)),
        (",1e-6,0,0,0,4e-6,0,0,0,9e-6", (1, 2, 3)),
    ],
)
def test_a_line_has_no_one_two_or_three_sigmas_or_a_diagonal_covariance(given, sigma_mm):
    (point,) = read_control_points(f"# id, name, X, Y, Z\n\n7,CP7,0,1,-.5{given}\n").values()
    assert point.xyz_mm == (0.0, 1000.0, -500.0)
    assert point.sigma_mm == pytest.approx(sigma_mm)


@pytest.mark.parametrize(
    ("header", "place"),
    [
        ("# id, N, E, H", (200.0, 100.0, 50.0)),
        ("# id, E, N, H", PLACE),
        ("# id, northing, easting, height (m)", (200.0, 100.0, 50.0)),
    ],
)
def test_surveyors_axes_are_read_by_their_names(header, place):
    assert first(f"{header}\n1,.1,.2,.05\n2,.3,.2,.06").xyz_mm == pytest.approx(place)


@pytest.mark.parametrize(
    "text",
    [
        "1,CP1,.1,.2,.05\n2,CP2,.3,.2,.06",
        "1,,.1,.2,.05",
        "1,101,.1,.2,.05,0,0,0",
        "1,.1,.2,.05",
        "1,.1,.2,.05\n2,.3,.2,.06,.001",
        "# Id, X, Y, Z\n1,CP1,.1,.2,.05",
        "# id, X, Y, Z\n1,.1,.2,.05",
        "# Id, name, X, Y, Z\n1,101,.1,.2,.05",
        "# Id, Name, X, Y, Z, sigmaX, sigmaY, sigmaZ\n1, 101, .1, .2, .05",
        "# no, z, y, x\n1,.05,.2,.1",
        "# Y X Z number\n.2,.1,.05,1",
        "# id, X, Y, Z (mm)\n1,100,200,50",
        "\ufeff# id, X, Y, Z (mm)\n1,100,200,50",
        "# id, X (cm), Y (cm), Z [cm]\n1,10,20,5",
        "# id, name, X_mm, Y_mm, Z_mm\n1,CP1,100,200,50",
    ],
)
def test_names_order_and_unit_are_those_that_the_list_leaves_no_doubt_of(text):
    assert first(text) == ControlPoint(PLACE)


@pytest.mark.parametrize(
    "text",
    [
        "# id, X, Y, Z, sigma (m)\n1,.1,.2,.05,.001",
        "# id, name, X, Y, Z, std\n1,101,.1,.2,.05,.001",
        "# sx, sy, sz, x, y, z, id (mm)\n1,1,1,100,200,50,1",
        "# id, X, Y, Z, sigma_xy, sigma_z\n1,.1,.2,.05,.001,.001",
        "# id, X, Y, Z, sx, sy, sz (mm)\n1,100,200,50,1,1,1",
    ],
)
def test_a_header_says_which_cell_is_the_sigma(text):
    assert first(text).xyz_mm == PLACE
    assert first(text).sigma_mm == pytest.approx((1, 1, 1))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "1,.1,.2,.05,.001\n2,.3,.2,.06,.001",
            "line 1: the second cell is a number in every line: it may be a",
        ),
        (
            "1,.1,.2,.05,.001\n2,.O3,.2,.06,.001",
            "line 2: the second cell is '.O3' here, and a number in other",
        ),
        ("1,a,nan,.2,.05", "line 1: nan is not a finite number"),
        ("1,a,.1,.2,1_0", "line 1: expected 3 numbers, found '.1 .2 1_0'"),
        ("1,a,.1,.2,.05\n2,b,.1,.2,.05,-1", "line 2: the standard deviation -1 is negative"),
        ("1,a,.1,.2,.05\n\n1,b,.3,.2,.06", "line 3: control point 1 is given in line 1 already"),
        ("1.5,a,.1,.2,.05", "line 1: control point 1.5 is not a whole number"),
        ("4294967297,a,.1,.2,.05", "is not a whole number"),
        ("1;a;.1;.2;.05", "line 1: 1 cell between commas, where id, X, Y, Z are"),
        ("1,a,.1,.2,.05" + ",0" * 4, "line 1: 9 cells between commas, where id, name, X, Y, Z are expected"),
        ("1,a,.1,.2,.05" + ",1e-6" * 9, "line 1: the coordinates are correlated"),
        ("1,a,.1,.2,.05,1,0,0,0,-1,0,0,0,1", "line 1: the covariance has a negative variance"),
        ("1,a,.1,.2,.05,1,.5,0,0,1,0,0,0,1", "line 1: the covariance is not symmetric"),
        (
            "1,a,.1,.2,.05,1\n2,b,.3,.4,.05,1",
            "line 1: a standard deviation of 1000 mm, and all points lie within",
        ),
        (
            "# id, X, Y, Z, sigma\n1,.1,.2,.05,.001\n2,.1,.2,.05,.001,.001",
            "line 3: 6 cells between commas, where id, X, Y, Z, s",
        ),
        ("# sigma, id, X, Y, Z\n1,.1,.2,.05", "line 2: 4 cells"),
        ("# id, X, Y, Z, weight\n1,.1,.2,.05,1", "line 1: 'weight' in the header is none of"),
        ("# id, X, Y, Z, X\n1,.1,.2,.05,1", "line 1: the header names 'x' twice"),
        ("# X, Y, Z\n.1,.2,.05", "line 1: the header names no id"),
        (
            "# id, X, Y, Z, sx, sy\n1,.1,.2,.05,0,0",
            "line 1: the header names id, x, y, z, sx, sy, of which not every",
        ),
        ("# id, X, Y, Z\n# id, Y, X, Z\n1,.1,.2,.05", "line 2: this is a second header"),
        ("# id, X (m), Y (m), Z (m), sigma (mm)\n1,.1,.2,.05,1", "line 1: the header states the units m, mm"),
        ("# id, X, Y, Z (ft)\n1,.1,.2,.05", "line 1: the header states the units ft"),
        ("# all in mm\n# id, X, Y, Z\n1,100,200,50", "line 1: this says mm, and no header says so"),
        ("# in micrometres\n1,a,100000,200000,50000", "line 1: this says micrometres, and no header says so"),
        ("# id, X_mm, Y_mm, Z_cm\n1,100,200,5", "line 1: the header states the units cm, mm"),
        (
            "# id, name, X, Y, Z (mm)\n1,a,100,1,50,2,3,5\n2,b,200,2,20,3,1,5",
            "line 2: 8 cells, and no decimal point in any line: decimal commas between commas?",
        ),
        ("# id, X, Y, Z (mm)\n1,100,200,50,2", "line 2: 5 cells, and no decimal point in any line"),
        ("# nothing\n", "holds no points"),
    ],
)
def test_a_list_that_is_wrong_or_in_doubt_is_refused_by_line(text, said):
    with pytest.raises(InputError) as caught:
        read_control_points(text)
    assert said in caught.value.message


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1 0 0 8\n1 0 5 8\n", "line 2: calibration point 1 is given in line 1 already"),
        ("1.5 0 0 8\n", "line 1: calibration point 1.5 is not a whole number"),
        ("1 0 inf 8\n", "line 1: inf is not a finite number"),
        ("1 0 0 8 .1\n", "line 1: expected 4 numbers"),
    ],
)
def test_a_calibration_body_has_each_point_once_and_nothing_else(text, said):
    with pytest.raises(InputError) as caught:
        read_calibration_points(text)
    assert said in caught.value.message
