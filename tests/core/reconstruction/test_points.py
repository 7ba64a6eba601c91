import numpy as np

from grabberd.core.reconstruction import Points


def test_a_mask_or_indices_choose_points():
    points = Points(
        np.array([3, 5, 8], np.int32), np.arange(9.0).reshape(3, 3), np.ones((3, 3, 3)), np.zeros((3, 3, 3)),
        np.arange(12.0).reshape(3, 2, 2), np.array([0.1, 0.2, 0.3]),
    )  # fmt: skip
    chosen = points.select(np.array([True, False, True]))
    assert chosen.target.tolist() == [3, 8]
    assert chosen.xyz_mm[1].tolist() == [6.0, 7.0, 8.0]
    assert chosen.image_px[1, 1].tolist() == [10.0, 11.0]
    assert points.select(np.array([1])).residual_px.tolist() == [0.2]


def test_no_points_have_the_shapes_of_points():
    assert len(Points.none()) == 0
    assert len(Points.none().select(np.zeros(0, np.intp))) == 0
