"""How wide the liner is at this moment."""

from dataclasses import replace

import numpy as np
import pytest

from core.reconstruction.liners import model, wall
from grabberd.core.reconstruction import ObjectModel, Points
from grabberd.core.reconstruction.section_width import facing_targets, section_widths


def points_of(model: ObjectModel, xyz_mm: np.ndarray, sigma_mm: float = 0.05) -> Points:
    count = len(model)
    covariance = np.tile(np.eye(3) * sigma_mm**2, (count, 1, 1))
    return Points(model.target, xyz_mm, covariance, covariance, np.zeros((count, 2, 2)), np.zeros(count))


def place(liner: ObjectModel, target: int) -> np.ndarray:
    return liner.xyz_mm[liner.target == target][0]


def test_targets_of_the_middle_row_face_each_other_from_outside_in() -> None:
    liner = model()
    assert facing_targets(liner) == [(49, 54), (50, 53), (51, 52)]
    assert set(liner.row[np.isin(liner.target, [49, 50, 51, 52, 53, 54])]) == {8}


def test_one_in_the_middle_of_an_odd_row_faces_nobody() -> None:
    one_row = replace(model(), row=np.zeros(108, np.int32), column=np.arange(108, dtype=np.int32))
    odd = replace(
        one_row, **{key: getattr(one_row, key)[:7] for key in ("target", "xyz_mm", "row", "column")}
    )
    assert facing_targets(odd) == [(1, 7), (2, 6), (3, 5)]
    alone = replace(odd, **{key: getattr(odd, key)[:1] for key in ("target", "xyz_mm", "row", "column")})
    assert facing_targets(alone) == []


def test_a_width_is_their_distance_with_its_sigma() -> None:
    liner = model()
    for width in section_widths(points_of(liner, liner.xyz_mm), liner):
        apart = place(liner, width.targets[1]) - place(liner, width.targets[0])
        assert width.width_mm == pytest.approx(np.linalg.norm(apart))
        assert width.sigma_mm == pytest.approx(0.05 * np.sqrt(2))


def test_a_liner_that_collapses_grows_wider() -> None:
    liner = model()
    widths = [section_widths(points_of(liner, wall(mm)[0]), liner)[0].width_mm for mm in (0.0, 3.0, 6.0)]
    known = [width for width in widths if width is not None]
    assert len(known) == 3
    assert known == sorted(known)
    assert known[-1] - known[0] > 0.5


def test_without_one_of_both_targets_there_is_none() -> None:
    liner = model()
    points = points_of(liner, liner.xyz_mm)
    widths = section_widths(points.select(points.target != 54), liner)
    assert (widths[0].targets, widths[0].width_mm, widths[0].sigma_mm) == ((49, 54), None, None)
    assert widths[1].width_mm is not None
    assert all(width.width_mm is None for width in section_widths(Points.none(), liner))


def test_targets_at_one_place_have_no_width() -> None:
    liner = model()
    assert section_widths(points_of(liner, np.zeros_like(liner.xyz_mm)), liner)[0].width_mm is None


def test_a_covariance_that_is_none_gives_no_sigma() -> None:
    liner = model()
    points = points_of(liner, liner.xyz_mm)
    first, *_ = section_widths(replace(points, covariance_mm2=-points.covariance_mm2), liner)
    assert first.width_mm is not None
    assert first.sigma_mm is not None
    assert np.isnan(first.sigma_mm)
