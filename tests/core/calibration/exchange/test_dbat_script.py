"""DBAT's project of five aerial images, as DBAT adjusts it, and scripts that ask for something else."""

from pathlib import Path

import numpy as np
import pytest

from grabberd.core.calibration.adjustment.adjustment import adjust
from grabberd.core.calibration.adjustment.starting_values import with_starting_values
from grabberd.core.calibration.dbat_script import read_dbat_script
from grabberd.errors import InputError

FOLDER = Path(__file__).parents[3] / "data/dbat/sxb"
SCRIPT = (FOLDER / "sxb.xml").read_text(encoding="utf-8")
CENTERS_M = [[999660.940086, 112368.368648, 1916.563176]]
"""Of the first image, in DBAT's report."""


def file(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8")


def test_the_project_is_adjusted_as_dbat_does():
    network, unknowns = read_dbat_script(SCRIPT, file)
    adjusted = adjust(with_starting_values(network), unknowns)
    assert adjusted.freedom == 1261
    assert adjusted.sigma0 == pytest.approx(1.17860, abs=5e-6)
    assert np.allclose(adjusted.views[0].center_mm / 1000, CENTERS_M, rtol=0, atol=1e-5)
    assert [view.name for view in adjusted.views] == ["8811", "8936", "8937", "8938", "9111"]


def test_filters_leave_control_points_out_and_their_image_points_in():
    network, _ = read_dbat_script(SCRIPT, file)
    known = network.ids[np.isfinite(network.target_sigma_mm).all(axis=1)]
    assert {351, 410} <= set(network.ids.tolist()) - set(known.tolist())
    only = SCRIPT.replace('<filter id="351,410">remove', '<filter id="351,410">keep', 1)
    kept, _ = read_dbat_script(only, file)
    assert set(kept.ids[np.isfinite(kept.target_sigma_mm).all(axis=1)].tolist()) == {351, 410}


def test_a_camera_that_is_adjusted_is_common_to_all_images():
    free = SCRIPT.replace(
        "<io>false</io>", "<io><all>true</all><aspect>false</aspect><skew>false</skew></io>"
    )
    _, unknowns = read_dbat_script(free, file)
    assert unknowns.names[:3] == ("lens.f_mm", "lens.x0_px", "lens.y0_px")
    assert len(unknowns) == 8 + 30


def test_a_sensor_of_automatic_width_and_default_values_start_from_the_focal_length():
    plain = SCRIPT.replace("53.14800,77.97600", "auto,77.976").replace("<io>loaded", "<io>default")
    network, _ = read_dbat_script(plain, file)
    view = network.views[0]
    assert (view.f_mm, view.x0_px, view.y0_px) == pytest.approx((123.0, 4429.0, 6498.0))


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("<io>false</io>", "<io><all>true</all></io>", "skew is not 0, or adjusted"),
        ("<aspect>1</aspect>", "<aspect>1.1</aspect>", "aspect is not 1"),
        ("<model>3</model>", "<model>-1</model>", "has model '-1'"),
        ("<P>0,0</P>", "<P>1e-5,0</P>", "decentering"),
        ("<project_unit>m<", "<project_unit>ft<", "unit is 'ft'"),
        ("53.14800,", "50,", "not square"),
        ("<all>true</all>", "<all>false</all>", "<eo> holds some"),
        ("<unit>mm<", "<unit>inch<", "unit is not mm"),
        ("spatial_resection", "guess", "operation 'guess' is not read"),
        ("<images ", "<prior_eo/><images ", "prior orientations"),
        ("reference/sxb-control.txt", "../../camcal-fixed.txt", "not in the script's own folder"),
        ("reference/sxb-control.txt", "/etc/passwd", "not in the script's own folder"),
        ("reference/sxb-control.txt", "C:\\control.txt", "not in the script's own folder"),
        ("reference/sxb-control.txt", "$HOME/control.txt", "not in the script's own folder"),
        ('base_dir="$HERE"', 'base_dir="/etc"', "not in the script's own folder"),
        ('format="id,im,x,y"', 'format="id,im,x"', "4 cells, and the script names 3"),
        ('sxy="0.5"', 'sxy="-1"', "not above 0"),
        ("<image_pts>", "<image_pts/><image_pts>", "2 parts <image_pts>"),
        ("</document>", "", "no element found"),
        ('<document dbat_script_version="1.0">', "<document>", "no script of DBAT"),
        ("<document ", "<!DOCTYPE a [<!ENTITY b 'c'>]><document ", "declares a document type"),
        ("<meta>", "<a>" * 50 + "</a>" * 50 + "<meta>", "40 levels"),
    ],
)
def test_what_is_not_read_is_refused_with_its_reason(old, new, why):
    assert old in SCRIPT
    with pytest.raises(InputError) as refused:
        read_dbat_script(SCRIPT.replace(old, new, 1), file)
    assert why in str(refused.value)
    assert refused.value.hint


@pytest.mark.parametrize(
    "name", ["images/images.txt", "measurements/markpts.txt", "reference/sxb-control.txt"]
)
def test_a_row_that_stands_twice_is_refused_by_its_line(name):
    def doubled(asked: str) -> str:
        text = file(asked)
        return text + text.splitlines()[1] + "\n" if asked == name else text

    with pytest.raises(InputError, match="line"):
        read_dbat_script(SCRIPT, doubled)
