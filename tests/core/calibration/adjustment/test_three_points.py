import numpy as np

from grabberd.core.calibration.adjustment.starting_values import poses_of_three
from grabberd.core.geometry import rotation_matrix

CASES = 500


def case(rng):
    """Three places before a camera at 240 mm, in whatever orientation, and the directions it sees them in."""
    places, turn = rng.uniform(-60, 60, (3, 3)), rotation_matrix(*rng.uniform(-3, 3, 3))
    center = turn.T @ [*rng.uniform(-30, 30, 2), 240.0]
    away = (places - center) @ turn.T
    return places, turn, center, away / np.linalg.norm(away, axis=1, keepdims=True)


def test_the_true_pose_is_among_at_most_four():
    rng, missed = np.random.default_rng(1), 0
    for _ in range(CASES):
        places, turn, center, directions = case(rng)
        found = list(poses_of_three(directions, places))
        assert len(found) <= 4
        off = [np.linalg.norm(at - center) + 240 * np.abs(one - turn).max() for one, at in found]
        missed += min(off, default=np.inf) > 0.1
    assert missed <= CASES // 100  # where two solutions nearly coincide


def test_every_solution_is_a_rotation_that_sees_the_points_where_they_are():
    rng, apart = np.random.default_rng(2), []
    for _ in range(CASES):
        places, _, _, directions = case(rng)
        for rotation, center in poses_of_three(directions, places):
            assert np.isclose(np.linalg.det(rotation), 1.0)
            seen = (places - center) @ rotation.T
            apart.append(np.abs(seen / np.linalg.norm(seen, axis=1, keepdims=True) - directions).max())
    assert np.quantile(apart, 0.98) < 1e-6


def test_points_on_a_line_give_no_more_than_rotations():
    line = np.outer([0.0, 1.0, 2.0], [10.0, 0.0, 0.0])
    directions = (line - [0, 0, 240.0]) / np.linalg.norm(line - [0, 0, 240.0], axis=1, keepdims=True)
    for rotation, _ in poses_of_three(directions, line):
        assert np.isclose(np.linalg.det(rotation), 1.0)
