"""Synthetic views of the simulated liner agree with its pictures, and a wrong surface does not."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from core.chain.fake_scene import take_scene
from grabberd.core.field import double_lines
from grabberd_liner.render import synthetic_view
from grabberd_liner.render.model_pictures import Gallery, Modelling
from grabberd_liner.render.wire_model import SIDES, Look

LOOK = Look(*SIDES["oblique"], 320, 240)


@cache
def scene():
    return take_scene(6, scene="liner", seed=11, picture={"stamp": False})


@cache
def modelling():
    measured = scene().measured(8, "field")
    return Modelling.of(scene().setup.object_model, [one.points for one in measured])


def points(n=4):
    return scene().measured(8, "field")[n].points


def field(n=4):
    return scene().fields[n][1]


def pair(moved_mm=0.0, grey=None):
    seen = points()
    moved = replace(seen, xyz_mm=seen.xyz_mm + np.array([0, 0, moved_mm]))
    return synthetic_view.synthetic_pair(
        modelling().surface(moved), scene().setup.calibration, grey or field()
    )


def test_the_views_fit_within_a_tenth_of_a_pixel_both_ways():
    for fit in pair().fit:
        assert len(fit.places) > 60
        assert (np.abs(fit.mean_px.value) < 0.1).all()
        assert (fit.mean_px.sigma < 0.02).all()
        assert fit.correlation > 0.95


@pytest.mark.parametrize("moved_mm", [0.5, -0.5])
def test_a_surface_half_a_millimetre_off_is_noticed(moved_mm):
    right, wrong = pair(), pair(moved_mm)
    for good, bad in zip(right.fit, wrong.fit, strict=True):
        assert abs(bad.mean_px.value[0]) > 0.8
        assert abs(bad.mean_px.value[0]) > 20 * bad.mean_px.sigma[0]
        assert bad.rms_grey > 1.5 * good.rms_grey
        assert bad.correlation < good.correlation - 0.05
    assert np.sign(wrong.fit[1].mean_px.value[0]) == np.sign(moved_mm)
    assert np.sign(wrong.fit[0].mean_px.value[0]) == -np.sign(moved_mm)


def test_a_doubled_field_is_matched_on_its_own_lines_too():
    intact, doubled = pair(), pair(grey=double_lines(field()))
    for one, other in zip(intact.fit, doubled.fit, strict=True):
        assert other.pixels == one.pixels
        assert other.mean_px.value == pytest.approx(one.mean_px.value, abs=0.02)


def test_what_cannot_be_matched_is_said_and_the_views_are_there_all_the_same():
    blank = replace(field(), luma=np.full_like(field().luma, 20))
    made = pair(grey=blank)
    assert made.fit == (None, None)
    assert [problem.split(":")[0] for problem in made.problems] == ["left view", "right view"]
    assert made.left.filled.any()


def test_empty_pixels_are_transparent_and_the_others_are_not():
    calibration = scene().setup.calibration
    frame = synthetic_view.frame_of(pair(), calibration)
    alpha = synthetic_view.see_through(frame)[:, :, 3]
    assert frame.shape == (576, 720)
    assert ((alpha == 255) == np.isfinite(frame)).all()
    assert 0.05 < np.isfinite(frame).mean() < 0.3


def test_laid_over_each_other_what_agrees_is_grey():
    frame = synthetic_view.frame_of(pair(), scene().setup.calibration)
    camera = double_lines(field()).luma
    over = synthetic_view.laid_over(np.where(np.isfinite(frame), camera, np.nan).astype(float), field())
    filled = np.isfinite(frame)
    assert (np.ptp(over.astype(int), axis=2) == 0).all()
    assert (over[filled, 0] == camera[filled]).all()
    difference = synthetic_view.difference(frame, field())
    assert (difference[~filled] == 128).all()
    assert abs(difference[filled].mean() - 128) < 2


def test_from_elsewhere_the_liner_fills_the_picture_and_shows_its_targets():
    surface, calibration = modelling().surface(points()), scene().setup.calibration
    view = synthetic_view.free_view(surface, calibration, field(), -60.0, 35.0, (400, 240))
    line, column = np.nonzero(view.filled)
    assert max(np.ptp(column) / 400, np.ptp(line) / 240) == pytest.approx(0.9, abs=0.03)
    assert np.nanpercentile(view.grey, 99) > 100


@pytest.mark.parametrize("quantity", [None, "height", "curvature", "strain", "movement", "sigma"])
def test_the_model_can_be_coloured_by_every_quantity(quantity):
    gallery = Gallery.of(modelling(), [points(0), points(5)], points(0), quantity)
    picture = gallery.picture(points(5), LOOK, "field 5")
    assert picture.shape == (240, 320, 3)
    assert (gallery.scale is None) == (quantity is None)
    saturation = np.ptp(picture.astype(int), axis=2)
    assert (saturation > 20).mean() > 0.01


def test_a_field_without_a_surface_is_drawn_as_an_empty_box():
    gallery = Gallery.of(modelling(), [points(0)], points(0), None)
    for nothing in (None, points(0).select(np.arange(5))):
        picture = gallery.picture(nothing, LOOK, "field 9")
        assert (np.ptp(picture.astype(int), axis=2) < 20).all()


def test_strain_and_movement_count_from_the_reference():
    for quantity in ("strain", "movement"):
        gallery = Gallery.of(modelling(), [points(2)], points(2), quantity)
        assert abs(gallery.scale.low) < 1e-6
        assert abs(gallery.scale.high) < 1e-5
