"""Rays of targets that one view alone sees."""

import numpy as np
import pytest

from grabberd.core.geometry import project_all
from grabberd.core.reconstruction import SingleViewImages
from grabberd_liner.analysis.load.targets import SightLines
from liner.analysis.walls import rig

RADIUS_MM, TAPER = 13.75, 0.02
ORIGIN_MM, AXES = np.array([1.0, -0.5, 0.3]), np.eye(3)
SIGMA_PX = 0.1
X_MM, THETA = (
    part.ravel() for part in np.meshgrid([-50.0, 0.0, 40.0], np.radians([-70.0, -50.0, 50.0, 70.0]))
)


def on_cone(taper=TAPER):
    """Targets on a cone, in its own frame."""
    radius = RADIUS_MM - taper * X_MM
    return np.column_stack([X_MM, radius * np.sin(THETA), radius * np.cos(THETA)])


def lines(places_mm, nominal_mm=None, random=None):
    """Rays of the targets from the view on their side."""
    view = (THETA > 0).astype(np.intp)
    ids = np.arange(len(view), dtype=np.int32)
    image_px = project_all(rig(), places_mm + ORIGIN_MM)[:, view, ids].T
    if random is not None:
        image_px = image_px + random.normal(size=image_px.shape) * SIGMA_PX
    images = SingleViewImages(ids, view, image_px, np.full(image_px.shape, SIGMA_PX))
    nominal_mm = places_mm if nominal_mm is None else nominal_mm
    return SightLines.of(rig(), images, ids.astype(np.intp), nominal_mm + ORIGIN_MM, ORIGIN_MM, AXES)


def radius(places_mm):
    return RADIUS_MM - TAPER * places_mm[:, 0]


def test_a_target_is_where_its_sights_say_whatever_its_nominal_place():
    places = on_cone()
    sights = lines(places, nominal_mm=places + np.array([2.0, -3.0, 4.0])).sights()
    seen = (sights.direction * places[sights.target]).sum(axis=1)
    assert seen == pytest.approx(sights.value, abs=1e-9)


def test_a_ray_meets_the_wall_where_the_target_is():
    places = on_cone()
    assert np.abs(lines(places, nominal_mm=places + 3.0).on_wall(radius, TAPER) - places).max() < 1e-6


def test_a_place_on_the_wall_leans_along_its_ray_as_the_wall_moves():
    one = lines(on_cone())
    inside, outside = (one.on_wall(lambda at, off=off: radius(at) + off, TAPER) for off in (-1e-4, 1e-4))
    difference = (outside - inside) / 2e-4
    assert np.abs(one.lean(on_cone(), TAPER) - difference).max() < 1e-5


def test_covariances_of_places_on_the_wall_are_those_of_many_draws():
    places = on_cone()
    random = np.random.default_rng(0)
    drawn = np.stack([lines(places, random=random).on_wall(radius, TAPER) for _ in range(1500)])
    found = np.einsum("kni,knj->nij", drawn - places, drawn - places) / len(drawn)
    expected = lines(places).covariance_mm2(places, TAPER)
    scale = np.trace(expected, axis1=1, axis2=2)[:, np.newaxis, np.newaxis]
    assert np.abs((found - expected) / scale).max() < 0.12


def test_sigma_of_a_sight_is_that_of_its_image_by_the_scale_of_the_picture():
    sights = lines(on_cone()).sights()
    sigma = np.sqrt(np.diagonal(sights.covariance))
    assert sigma == pytest.approx(SIGMA_PX * 0.25, rel=0.15)
