"""The whole way from fields of the simulated grabber to points, against its truth."""

import itertools

import numpy as np
import pytest

from core.chain.fake_scene import coordinates, take_scene
from grabberd.core.chain.locating import whole_blobs
from grabberd.core.chain.measure import Trackers, measure_fields
from grabberd.core.field import TOP, Field, quantise
from grabberd.core.geometry import LocalField
from grabberd.core.measurement import Blobs
from grabberd.core.reconstruction.accuracy import accuracy

FIELDS = 60
WAYS = [(1, "doubled"), (1, "field"), (8, "field")]


@pytest.fixture(scope="module")
def liner():
    """The pulsating liner before the default rig: 2 % noise, jitter .12 px, local mirror errors .06 px."""
    return take_scene(FIELDS, scene="ellipse")


@pytest.fixture(scope="module")
def liner_without_mirror_errors():
    return take_scene(FIELDS, scene="ellipse", rig={"mirror_error_px": 0.0})


def points_of(scene, bits, lines):
    return coordinates(scene.measured(bits, lines))


def bytes_of(measured):
    return [(one.n, one.time_ns, *(array.tobytes() for array in arrays_of(one))) for one in measured]


def arrays_of(one):
    return (
        one.points.target,
        one.points.xyz_mm,
        one.points.covariance_mm2,
        one.blobs.xy_px,
        one.blobs.sigma_px,
    )


@pytest.mark.parametrize(("bits", "lines"), WAYS)
def test_every_target_that_both_views_see_is_found_under_its_own_id(liner, bits, lines):
    report = accuracy(points_of(liner, bits, lines), liner.truth)
    assert report.fields == FIELDS
    assert (report.wrong, report.unknown) == (0, 0)
    assert report.missing <= 0.01 * liner.truth.expected.sum()


@pytest.mark.parametrize(("way", "limit_mm"), [*zip(WAYS, [0.095, 0.120, 0.066], strict=True)])
def test_the_error_in_space_with_local_mirror_errors(liner, way, limit_mm):
    assert accuracy(points_of(liner, *way), liner.truth).rmse.xyz_mm <= limit_mm


@pytest.mark.parametrize(("way", "limit_mm"), [*zip(WAYS, [0.079, 0.107, 0.045], strict=True)])
def test_the_error_in_space_without_them(liner_without_mirror_errors, way, limit_mm):
    scene = liner_without_mirror_errors
    assert accuracy(points_of(scene, *way), scene.truth).rmse.xyz_mm <= limit_mm


@pytest.mark.parametrize(("bits", "lines"), WAYS)
def test_the_covariance_says_how_large_the_errors_are(liner_without_mirror_errors, bits, lines):
    scene = liner_without_mirror_errors
    true = dict(zip(zip(scene.truth.n, scene.truth.target, strict=True), scene.truth.xyz_mm, strict=True))
    squared = [
        (one.points.xyz_mm - [true[one.n, target] for target in one.points.target]) ** 2
        / np.diagonal(one.points.covariance_mm2, axis1=1, axis2=2)
        for one in scene.measured(bits, lines)
    ]
    in_sigmas = np.sqrt(np.concatenate(squared).mean(axis=0))
    assert ((in_sigmas > 0.7) & (in_sigmas < 1.5)).all(), in_sigmas


@pytest.mark.parametrize(("bits", "lines"), WAYS)
def test_the_same_fields_give_the_same_points_bit_for_bit(liner, bits, lines):
    again = measure_fields(itertools.islice(liner.packed(bits, lines), 20), liner.setup)
    assert bytes_of(again) == bytes_of(liner.measured(bits, lines)[:20])


@pytest.mark.parametrize(("bits", "lines"), WAYS)
def test_trackers_that_have_measured_other_fields_give_the_same_points_bit_for_bit(liner, bits, lines):
    trackers, packed = Trackers(liner.setup), list(liner.packed(bits, lines))
    for other in (packed[30:], packed[10:25]):
        assert list(measure_fields(other, liner.setup, trackers=trackers))
    again = measure_fields(packed[:20], liner.setup, trackers=trackers)
    assert bytes_of(again) == bytes_of(liner.measured(bits, lines)[:20])


def test_the_line_jitter_is_asked_of_the_first_nine_fields_and_then_of_every_twenty_fifth(liner):
    found = [one.blobs.line_jitter_px for one in liner.measured(8, "field")]
    asked = [n for n, jitter_px in enumerate(found) if jitter_px is not None]
    assert asked == [*range(9), 25, 50]
    assert [found[n] for n in asked] == pytest.approx([0.12] * 11, rel=0.35)


def test_each_field_is_answered_before_the_next_is_taken(liner):
    taken = []
    fields = (taken.append(one.n) or one for one in itertools.cycle(liner.packed(1, "doubled")))
    results = measure_fields(fields, liner.setup)
    for n in range(3):
        assert next(results).n == n
        assert taken == list(range(n + 1))


@pytest.mark.parametrize("lost", [1, 2, 10], ids=["one lost", "two lost", "a fifth of a second lost"])
def test_ids_stay_through_lost_fields(liner, lost):
    fields = [one for one in liner.packed(1, "doubled") if not 25 <= one.n < 25 + lost]
    points = coordinates(measure_fields(fields, liner.setup))
    report = accuracy(points, liner.truth)
    assert (report.fields, report.wrong) == (FIELDS - lost, 0)
    assert report.missing <= 0.01 * liner.truth.expected.sum()


def test_a_field_without_targets_has_no_points_and_the_next_one_has(liner):
    fields = list(liner.packed(1, "doubled"))[:6]
    dark = quantise(Field(np.zeros((576, 720), np.uint8), TOP, 0, 1), 1, 100)
    fields[3] = fields[3]._replace(packed=dark)
    counts = [len(one.points) for one in measure_fields(fields, liner.setup)]
    assert counts[3] == 0
    assert min(counts[2], counts[4], counts[5]) > 60


def test_a_time_that_does_not_advance_makes_no_velocity_but_points(liner):
    first = next(iter(liner.packed(1, "doubled")))
    once, again = measure_fields([first, first], liner.setup)
    np.testing.assert_array_equal(once.points.xyz_mm, again.points.xyz_mm)
    assert len(again.points) > 60


def test_a_ring_that_is_armed_anew_with_other_lines_begins_anew(liner):
    fields = [*list(liner.packed(1, "doubled"))[:3], *list(liner.packed(8, "field"))[3:6]]
    anew = list(measure_fields(fields, liner.setup))[3:]
    alone = list(measure_fields(fields[3:], liner.setup))
    assert bytes_of(anew) == bytes_of(alone)


def test_a_view_has_its_own_whole_blobs_only(liner):
    left, right = liner.setup.calibration.views
    xy_px = np.array([[100.0, 50.0], [357.5, 60.0], [362.0, 70.0], [400.0, 80.0], [500.0, 90.0]])
    six = np.full(5, 6.0)
    cut_off = np.array([False, False, False, False, True])
    blobs = Blobs(xy_px, np.full((5, 2), 0.1), np.zeros(5), six**2, six, six, cut_off, 2.0)
    assert whole_blobs(blobs, left).xy_px.tolist() == [[100.0, 50.0]]
    assert whole_blobs(blobs, right).xy_px.tolist() == [[400.0, 80.0]]


def test_a_views_local_field_is_taken_off_its_blobs(liner):
    x_only = np.full((41, 50, 2), (0.25, 0.0))
    local_field = LocalField.through((-0.5, -0.5), 15.0, x_only, np.zeros_like(x_only))
    blobs = Blobs(
        np.array([[100.0, 50.0]]), np.full((1, 2), 0.1), *np.full((4, 1), 6.0), np.zeros(1, bool), 2.0
    )
    left, _ = liner.setup.calibration.views
    assert whole_blobs(blobs, left, local_field).xy_px == pytest.approx(np.array([[99.75, 50.0]]))
