import numpy as np

from grabberd.core.reconstruction.points import Points, PointSeries


def points(targets, start):
    count = len(targets)
    return Points(
        np.array(targets, np.int32),
        start + np.arange(3.0 * count).reshape(count, 3),
        np.tile(np.eye(3), (count, 1, 1)),
        np.tile(2 * np.eye(3), (count, 1, 1)),
        np.ones((count, 2, 2)),
        np.ones(count),
    )


SERIES = PointSeries.of(
    [(10, 1_000, points([3, 8], 0.0)), (11, 1_500, Points.none()), (13, 9_000, points([5], 50.0))]
)


def test_fields_and_all_their_targets_stand_in_order():
    assert SERIES.n.tolist() == [10, 11, 13]
    assert SERIES.target.tolist() == [3, 5, 8]
    assert np.allclose(SERIES.time_s, [0.0, 0.5e-6, 8e-6])


def test_a_point_stands_at_its_field_and_target_and_nan_where_there_is_none():
    assert SERIES.seen.tolist() == [[True, False, True], [False, False, False], [False, True, False]]
    assert SERIES.xyz_mm[0, 2].tolist() == [3.0, 4.0, 5.0]
    assert SERIES.calibration_covariance_mm2[2, 1].tolist() == (2 * np.eye(3)).tolist()
    assert np.isnan(SERIES.xyz_mm[1]).all()


def test_parity_alternates_with_the_field_number_lost_fields_counted():
    assert SERIES.parity.tolist() == [0, 1, 1]


def test_points_can_be_taken_out():
    gone = np.zeros((3, 3), bool)
    gone[0, 2] = True
    assert SERIES.without(gone).seen.sum() == 2


def test_of_nothing_there_is_an_empty_series():
    empty = PointSeries.of([])
    assert empty.xyz_mm.shape == (0, 0, 3)
    assert PointSeries.of([(4, 0, Points.none())]).covariance_mm2.shape == (1, 0, 3, 3)
