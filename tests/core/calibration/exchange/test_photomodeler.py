"""The camera calibration data set of DBAT gives the figures that DBAT publishes for it.

Theirs are in data/dbat/dbatexports of version 0.9.2.0: camcal-dbatreport-model-1, -model1 and -model3.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from grabberd.core.calibration.adjustment.adjustment import adjust
from grabberd.core.calibration.adjustment.network import LENS, Unknowns
from grabberd.core.calibration.adjustment.starting_values import POSE, with_starting_values
from grabberd.core.calibration.control_points import read_control_points
from grabberd.core.calibration.exchange import read_photomodeler
from grabberd.errors import InputError

ROOT = Path(__file__).parents[4]
EXPORT = (ROOT / "tests/data/dbat/camcal-pmexport.txt").read_text("utf-8")
CONTROL = read_control_points((ROOT / "tests/data/dbat/camcal-fixed.txt").read_text("utf-8"))
FORWARD = {"sigma0": 1.62168, "f": 7.45748, "x": 3.61634, "y": 2.60757, "f_sigma": 0.00107}
FORWARD_B = (-0.00453336, 9.80889e-05, -1.82929e-07, 5.69267e-05)
BACKWARD = {"sigma0": 1.68901, "f": 7.4574, "x": 3.61589, "y": 2.60842, "f_sigma": 0.00109}
BACKWARD_B = (0.00457215, -4.26222e-05, -2.16112e-06, -6.56706e-05)


def started(polynomial):
    """The network with nothing known but image points, control points and the focal length of the EXIF."""
    network = read_photomodeler(EXPORT, CONTROL, f_mm=7.3, polynomial=polynomial)
    return with_starting_values(
        replace(
            network,
            views=tuple(view.with_vector(view.vector() * [*(1,) * 3, *(0,) * 15]) for view in network.views),
            target_mm=np.where(np.isinf(network.target_sigma_mm), 0.0, network.target_mm),
        )
    )


@pytest.mark.parametrize(
    ("polynomial", "theirs", "their_b"),
    [("distortion", FORWARD, FORWARD_B), ("correction", BACKWARD, BACKWARD_B)],
)
def test_its_figures_are_those_of_dbat(polynomial, theirs, their_b):
    network = replace(started(polynomial), among_corrected=polynomial == "correction")
    ours = adjust(network, Unknowns.of(network.views, (*LENS, *POSE), shared=LENS))
    view = ours.views[0]
    assert ours.freedom == 3726
    assert ours.sigma0 == pytest.approx(theirs["sigma0"], abs=6e-6)
    assert view.f_mm == pytest.approx(theirs["f"], abs=6e-6)
    assert view.x0_px * view.pixel_x_mm == pytest.approx(theirs["x"], abs=6e-6)
    assert view.y0_px * view.pixel_y_mm == pytest.approx(theirs["y"], abs=6e-6)
    assert view.b[2:6] == pytest.approx(their_b, rel=3e-6)
    assert ours.sigma[ours.unknowns.names.index("lens.f_mm")] == pytest.approx(theirs["f_sigma"], abs=6e-6)


def test_the_scripts_of_the_manual_give_dbats_model_with_aspect(monkeypatch):
    monkeypatch.chdir(ROOT)
    scripts = re.findall("```python\n(.*?)```", (ROOT / "docs/howto/networks.md").read_text("utf-8"), re.S)
    assert max(len(script.splitlines()) for script in scripts) <= 25
    names: dict = {}
    for script in scripts[:2]:
        exec(script, names)
    view = names["third"].views[0]
    assert names["freedom"] == 3725
    assert names["sigma0"] == pytest.approx(1.6148, abs=6e-6)
    assert names["aspect"] == pytest.approx(0.000389598, rel=1e-5)
    assert view.f_mm == pytest.approx(7.457, abs=6e-6)
    assert view.b[2:7] == pytest.approx(
        (0.00458861, -4.51351e-05, -2.05253e-06, -6.12803e-05, -4.41172e-05), rel=3e-6
    )


def test_unknown_control_points_and_incomplete_files_are_refused():
    with pytest.raises(InputError, match="control point 7777 is on no image"):
        read_photomodeler(EXPORT, {7777: CONTROL[1001]})
    with pytest.raises(InputError, match="the bundle project ends after line 40"):
        read_photomodeler("\n".join(EXPORT.splitlines()[:40]), CONTROL)
    with pytest.raises(InputError, match="line 2: expected 4 numbers, found 'no numbers'"):
        read_photomodeler("a title\nno numbers\n", CONTROL)


MARK = "   0        3 1217"
UNSTATED, STATED = "\n\n\n       2", "\n\n7 0 1 0 .1 -.5 .1\n\n       2"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("2272 1704", "2272.5 1704", "line 2: the picture's size 2272.5 is not a whole number"),
        ("2272 1704", "2272 -1704", "line 2: -1704 is not above 0"),
        (" 0.10000 10.0", " 0 10.0", "line 3: 0 is not above 0"),
        (" 7.4653 ", " nan ", "line 4: nan is not a finite number"),
        ("   1 data", "   7 data", "line 12: expected image 1, found '7'"),
        ("   1    0.470", "   2    0.470", "line 13: expected image 1, found '2'"),
        (UNSTATED, STATED, "line 133: the standard deviation -0.5 is negative"),
        ("       3    0.42863", "       2    0.42863", "object point 2 is given in line 134 already"),
        (MARK, "  21        3 1217", "line 236: there is no image 21"),
        (MARK, "  -1        3 1217", "line 236: there is no image -1"),
        (MARK, "   0      3.5 1217", "line 236: the number 3.5 is not a whole number"),
        (MARK, "   0        2 1217", "line 236: image 0 shows object point 2 in line 235 already"),
    ],
)
def test_what_a_project_cannot_mean_is_refused_by_line(old, new, said):
    assert old in EXPORT
    with pytest.raises(InputError, match=said):
        read_photomodeler(EXPORT.replace(old, new, 1), CONTROL)


def test_control_points_in_another_unit_than_the_project_are_refused():
    millimetres = {
        number: replace(one, xyz_mm=tuple(1000 * x for x in one.xyz_mm)) for number, one in CONTROL.items()
    }
    with pytest.raises(InputError, match="control points are 1000 times as far apart"):
        read_photomodeler(EXPORT, millimetres)
