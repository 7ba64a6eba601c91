"""Means of the fields of a still wall: the noise falls with their number, what is common stays."""

from dataclasses import replace

import numpy as np
import pytest

from grabberd_liner.analysis.pulsation.movement import TimedPoints
from grabberd_liner.chain.analysis.wall_state import FieldPoints, averaged_fields
from liner.analysis.walls import outermost_alone, solved_six

SIGMA_MM = np.array([0.01, 0.01, 0.03])


def fields(count=100, seen=None):
    liner, random = solved_six("reference-empty"), np.random.default_rng(3)
    made = []
    for n in range(count):
        points = outermost_alone(liner, liner.places_mm(0.0), SIGMA_MM, random)
        points = replace(points, calibration_covariance_mm2=np.tile(np.eye(3) * 4e-4, (len(points), 1, 1)))
        made.append(FieldPoints(n, TimedPoints(0.02 * n, points if seen is None else points.select(seen(n)))))
    return made


def test_every_so_many_fields_become_one():
    means = averaged_fields(fields(25), 10)
    assert [one.n for one in means] == [0, 1, 2]
    assert [one.timed.time_s for one in means] == pytest.approx([0.09, 0.29, 0.44])


def test_one_field_each_leaves_them_as_they_are():
    before = fields(3)
    assert averaged_fields(before, 1) == before


def test_noise_falls_with_the_number_and_is_as_its_covariance_says():
    liner = solved_six("reference-empty")
    (mean,) = averaged_fields(fields(), 100)
    off = mean.timed.points.xyz_mm - liner.places_mm(0.0)[liner.inner]
    assert off.std(axis=0) == pytest.approx(SIGMA_MM / 10, rel=0.3)
    sigma = np.sqrt(np.diagonal(mean.timed.points.covariance_mm2, axis1=1, axis2=2))
    assert sigma == pytest.approx(np.tile(SIGMA_MM / 10, (len(sigma), 1)))


def test_what_the_calibration_errs_by_is_not_averaged():
    (mean,) = averaged_fields(fields(), 100)
    assert mean.timed.points.calibration_covariance_mm2[0] == pytest.approx(np.eye(3) * 4e-4)


def test_images_that_one_view_sees_alone_are_averaged_as_well():
    single, (mean,) = fields(1)[0].timed.points.single, averaged_fields(fields(), 100)
    found = mean.timed.points.single
    assert found.target.tolist() == single.target.tolist()
    assert found.view.tolist() == single.view.tolist()
    assert found.sigma_px == pytest.approx(single.sigma_px / 10)


def test_a_target_that_is_rarely_seen_is_left_out():
    def seen(n):
        count = int(solved_six("reference-empty").inner.sum())
        return np.arange(count) > 0 if n % 3 else np.arange(count) >= 0

    means = averaged_fields(fields(9, seen), 9)
    assert len(means[0].timed.points) == int(solved_six("reference-empty").inner.sum()) - 1
