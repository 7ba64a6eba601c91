"""Where a calibration is good, by drawn calibrations and by points intersected from projections alone."""

import numpy as np
import pytest

from core.calibration.networks import frame, network, tied
from grabberd.core.calibration.adjustment.adjustment import adjust
from grabberd.core.calibration.validity import (
    SHIFT_PX,
    TURN_DEG,
    Calibrated,
    Volume,
    moved_view,
    movement_errors,
    point_sigma,
    projection_sigma,
    validity_document,
)
from grabberd.core.geometry import LocalField, LocalFields, project

PLACES = frame()
ADJUSTED = adjust(network(sigma_px=0.05), tied())
KNOWN = Calibrated(ADJUSTED.views, ADJUSTED.parameter_covariance, LocalFields(None, None), 576)
VOLUME = Volume(PLACES.min(axis=0), PLACES.max(axis=0), (0.05, 0.07))
LOOKED_AT = np.array([[0.0, 0.0, 0.0], [-40.0, 20.0, 6.0], [50.0, -20.0, -6.0], [0.0, 0.0, 14.0]])


def intersected(views, pictures) -> np.ndarray:
    """Places of least squares by projections and their differences over 10 µm alone."""
    places = LOOKED_AT[:1] * np.ones((len(pictures[0]), 1))
    shifts = 0.01 * np.eye(3)
    for _ in range(6):
        off = np.concatenate(
            [seen - project(view, places) for view, seen in zip(views, pictures, strict=True)], 1
        )
        slopes = [
            np.concatenate(
                [(project(view, places + one) - project(view, places - one)) / 0.02 for view in views], 1
            )
            for one in shifts
        ]
        design = np.stack(slopes, axis=2) / np.tile(VOLUME.pointing_px, 2)[:, np.newaxis]
        weighted = (off / np.tile(VOLUME.pointing_px, 2))[:, :, np.newaxis]
        places = (
            places
            + np.linalg.solve(design.swapaxes(1, 2) @ design, design.swapaxes(1, 2) @ weighted)[:, :, 0]
        )
    return places


def drawn(count: int, seed: int, share: float = 1.0):
    """Calibrations as the covariance has them, with a share of their errors."""
    rng, unknowns = np.random.default_rng(seed), ADJUSTED.unknowns
    values, vectors = np.linalg.eigh(ADJUSTED.correlation)
    for normal in rng.normal(size=(count, len(values))):
        off = ADJUSTED.sigma * (vectors @ (np.sqrt(np.maximum(values, 0.0)) * normal))
        yield unknowns.with_values(ADJUSTED.views, ADJUSTED.values + share * off)


@pytest.mark.parametrize(("share", "relative"), [(0.1, 0.05), (1.0, 0.08)])
def test_the_projections_sigma_is_that_of_drawn_calibrations(share, relative):
    shown = np.array([[project(view, LOOKED_AT) for view in views] for views in drawn(2000, 5, share)])
    for index in (0, 1):
        sigma = projection_sigma(KNOWN, index, LOOKED_AT)
        assert np.allclose(sigma, shown[:, index].std(axis=0) / share, rtol=relative)


def test_a_points_sigma_is_that_of_drawn_calibrations_and_drawn_pictures():
    calibration, total = point_sigma(KNOWN, VOLUME, LOOKED_AT)
    pictures = [project(view, LOOKED_AT) for view in ADJUSTED.views]
    by_calibration = np.array([intersected(views, pictures) for views in drawn(200, 6)])
    assert np.allclose(calibration, by_calibration.std(axis=0), rtol=0.16)
    rng = np.random.default_rng(7)
    noisy = np.array(
        [
            intersected(views, [one + rng.normal(size=one.shape) * VOLUME.pointing_px for one in pictures])
            for views in drawn(200, 8)
        ]
    )
    assert np.allclose(total, noisy.std(axis=0), rtol=0.16)


def test_the_sigma_of_a_local_field_is_part_of_the_projections():
    field = LocalField.unknown(0, 360, 576, 0.3)
    known = KNOWN._replace(local_fields=LocalFields(field, None))
    without, with_it = (projection_sigma(one, 0, LOOKED_AT) for one in (KNOWN, known))
    assert np.allclose(np.sqrt(with_it**2 - without**2), 0.3, rtol=1e-6)


@pytest.mark.parametrize("movement", ["shift_x", "shift_y", "turn_x", "turn_y", "turn_z"])
@pytest.mark.parametrize("index", [0, 1])
def test_a_views_movement_costs_what_a_second_intersection_finds(index, movement):
    errors = movement_errors(KNOWN, VOLUME, index, movement)
    low, high = VOLUME.low_mm, VOLUME.high_mm
    places = np.array(
        [
            VOLUME.middle_mm,
            *([x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])),
        ]
    )
    views = list(ADJUSTED.views)
    views[index] = moved_view(views[index], movement)
    pictures = [project(view, places) for view in views]
    assert np.allclose(errors, intersected(ADJUSTED.views, pictures) - places, atol=1e-5)
    assert 1e-3 < np.abs(errors).max() < 0.5


def test_a_movement_is_of_the_stated_size_in_the_picture():
    view = ADJUSTED.views[0]
    shifted = project(moved_view(view, "shift_y"), LOOKED_AT) - project(view, LOOKED_AT)
    assert np.allclose(shifted, [0.0, SHIFT_PX])
    turned = moved_view(view, "turn_z").axes @ view.axes.T
    assert np.degrees(np.arccos((np.trace(turned) - 1) / 2)) == pytest.approx(TURN_DEG)
    assert np.allclose(moved_view(view, "turn_x").center_mm, view.center_mm)


def test_places_outside_of_the_frames_volume_are_marked_and_those_that_one_view_misses_are_empty():
    document = validity_document(KNOWN, VOLUME)
    for shown in document["views"]:
        inside, total = np.array(shown["inside"]), np.array(shown["point_mm"]["z"], float)
        assert 0.2 < inside.mean() < 0.9
        assert np.isfinite(total[inside]).all()
        assert np.isnan(total).any()
        assert np.nanmedian(total[~inside]) > np.nanmedian(total[inside])
        assert np.isfinite(np.array(shown["projection_px"]["x"], float)).all()
    depths = document["depths"]
    assert [*depths["inside"]] == [VOLUME.low_mm[2] <= z <= VOLUME.high_mm[2] for z in depths["z_mm"]]
    assert depths["z_mm"][0] < VOLUME.low_mm[2] < VOLUME.high_mm[2] < depths["z_mm"][-1]
    assert depths["total"]["z"][0] > depths["calibration"]["z"][0] > 0


def test_a_corner_that_a_view_does_not_see_has_no_error():
    wide = VOLUME._replace(low_mm=VOLUME.low_mm - (60.0, 0.0, 0.0))
    errors = movement_errors(KNOWN, wide, 0, "shift_x")
    assert np.isnan(errors[1:5]).all()
    assert np.isfinite(errors[5:]).all()
