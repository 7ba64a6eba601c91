import re

import numpy as np
import pytest

from grabberd.reports.figures import (
    correlation_svg,
    distribution_svg,
    field_svg,
    geometry_svg,
    residuals_svg,
    validation_svg,
    validity_svg,
    volume_svg,
)
from grabberd.reports.figures.drawing import WIDTH_MM, enlargement, nice
from reports.documents import full, least

GRID = {"view": "left", "columns": [10.0, 20.0, 30.0], "lines": [5.0, 15.0]}
CAMERA = {
    "axis": [0.0, 0.0, -1.0],
    "corners": [[-0.3, -0.4, -1], [0.3, -0.4, -1], [-0.3, 0.4, -1], [0.3, 0.4, -1]],
}


@pytest.fixture(scope="module")
def document():
    return full()


def camera(name, x_mm):
    return {**CAMERA, "name": name, "center_mm": [x_mm, 0.0, 240.0]}


def points_of(svg, colour):
    """Places in points of the discs of one colour, as the drawing uses them."""
    uses = re.findall(r'<use [^>]*x="([\d.]+)" y="([\d.]+)" style="fill: ([#\w]+)', svg)
    return np.array([(float(x), float(y)) for x, y, fill in uses if fill == colour])


def test_the_imaging_geometry_is_to_scale():
    targets = [[-20, 0, 0], [20, 0, 0], [0, 40, 0], [0, -40, 0]]
    inwards = np.array([[0.27, -0.4, -1], [0.27, 0.4, -1]])
    left = camera("left", -64.0) | {"corners": inwards.tolist()}
    right = camera("right", 64.0) | {"corners": (inwards * (-1, 1, 1)).tolist()}
    geometry = {
        "cameras": [left, right],
        "targets_mm": targets,
        "base_mm": 128.0,
        "distance_mm": 240.0,
        "convergence_deg": 29.86,
    }
    svg, scale = geometry_svg(geometry, "rig")
    apart_pt = points_of(svg, "#b34700")[0] - points_of(svg, "#0072b2")[0]
    paper_mm = np.linalg.norm(apart_pt) / 72 * 25.4
    assert paper_mm * scale == pytest.approx(128.0, abs=0.05)
    sides = (re.search(rf'<svg[^>]* {side}="([\d.]+)pt"', svg) for side in ("width", "height"))
    width_pt, height_pt = (found[1] for found in sides)
    assert float(width_pt) == pytest.approx(WIDTH_MM / 25.4 * 72, abs=0.01)
    assert float(height_pt) < 160 / 25.4 * 72
    assert all(said in svg for said in ("base 128", "distance 240", "29.86°"))


def test_views_that_do_not_converge_have_no_angle():
    cameras = [camera("left", -64.0), camera("right", 64.0)]
    svg, _ = geometry_svg({"cameras": cameras, "targets_mm": [[0, 0, 0]], "convergence_deg": 0.0}, "rig")
    assert "°" not in svg


def test_cameras_of_a_mirrored_or_turned_frame_are_drawn_from_their_own_base():
    geometry = {
        "cameras": [camera("right", 64.0), camera("left", -64.0)],
        "targets_mm": [[0, 0, 0], [5, 5, 5]],
    }
    turned = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    for one in geometry["cameras"]:
        one.update({key: (np.array(one[key]) @ turned).tolist() for key in ("center_mm", "axis", "corners")})
    geometry["targets_mm"] = (np.array(geometry["targets_mm"]) @ turned).tolist()
    svg, scale = geometry_svg(geometry, "rig")
    assert scale > 0
    assert "base" not in svg


@pytest.mark.parametrize(("value", "expected"), [(7.3, 5), (0.0199, 0.01), (0.02, 0.02), (1.0, 1), (99, 50)])
def test_scales_are_round(value, expected):
    assert nice(value) == pytest.approx(expected)


def test_vectors_are_enlarged_until_nearly_all_have_room():
    assert enlargement([0.1] * 99 + [5.0], 40.0) == 200
    assert enlargement([0.0, 0.0], 40.0) == 1.0


def test_the_scale_of_residuals_is_said(document):
    assert re.search(r"[\d.]+ px, enlarged \d+ times", residuals_svg(document, "residuals"))


def test_a_field_that_is_zero_or_partly_unknown_can_be_drawn():
    zero = {**GRID, "dx_px": [[0.0] * 3] * 2, "dy_px": [[0.0] * 3] * 2}
    partly = {
        **GRID,
        "dx_px": [[0.1, None, 0.3], [0.1, 0.2, None]],
        "dy_px": [[0.0, None, 0.1], [0.1, 0.1, None]],
    }
    assert "<svg" in field_svg(least(), [zero], "zero")
    assert "<svg" in field_svg(least(), [partly], "partly")


def test_a_volume_that_no_view_sees_or_that_is_even_can_be_drawn():
    for value in (None, 0.02):
        grids = dict.fromkeys("xyz", [[value] * 3] * 4)
        volume = {"x_mm": [0, 1, 2, 3], "y_mm": [0, 1, 2], "planes": [{"z_mm": 0.0, "total": grids}]}
        assert "Z = 0.0 mm" in volume_svg(volume, "total", "a volume")


def test_what_lies_outside_of_the_frames_volume_is_hatched(document):
    svg = validity_svg(document["validity"], "where it is good")
    assert "hatch" in svg or "pattern" in svg
    assert "σ over the volume" in svg


def test_a_validity_without_any_place_that_both_views_see_can_be_drawn(document):
    validity = document["validity"]
    blind = [
        view | {"point_mm": {axis: [[None] * len(view["columns"])] * len(view["lines"]) for axis in "xyz"}}
        for view in validity["views"]
    ]
    depths = validity["depths"] | {"inside": [False] * len(validity["depths"]["z_mm"])}
    assert "<svg" in validity_svg(validity | {"views": blind, "depths": depths}, "blind")


def test_one_view_alone_can_be_drawn(document):
    alone = document | {
        "residuals": [row for row in document["residuals"] if row["view"] == "left"],
        "blunders": None,
    }
    assert "right</text>" not in distribution_svg(alone, "distribution")
    assert "#b34700" not in residuals_svg({**alone, "views": document["views"][:1]}, "residuals")


def test_two_unknowns_have_one_correlation():
    svg = correlation_svg(
        {"names": ["lens.f_mm", "left.b1"], "correlation": [[1.0, -0.97], [-0.97, 1.0]]}, 0.95, "correlation"
    )
    assert "b₁" in svg


def test_one_held_out_target_can_be_drawn():
    point = {f"{kind}{axis}_mm": 0.01 for kind in ("d", "sigma_") for axis in "xyz"}
    assert "predicted σ [mm]" in validation_svg([point], "validation")


def test_figures_hold_no_picture_date_or_program(document):
    svg = residuals_svg(document, "residuals")
    assert not re.search(r"metadata|<image|atplotlib|<\?xml|DOCTYPE|<style", svg)
