"""What the camera sees and what is true of it."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from grabberd_fake import FakeOptions, World, read_stamp

MakeWorld = Callable[..., World]
Shoot = Callable[..., NDArray[np.uint8]]
SPREAD_OUT = {"scene": "accuracy_object", "rig": {"mirror_error_px": 0.3}}


def centroids(
    luma: NDArray[np.uint8], parity: int, places: Any, background: float = 20.0
) -> NDArray[np.float64]:
    """(N, 2) grey centroids of windows round the expected places."""
    found = []
    for x, y in places:
        row, column = round((y - parity) / 2), round(x)
        window = luma[row - 5 : row + 6, column - 8 : column + 9].astype(float) - background
        rows, columns = np.mgrid[row - 5 : row + 6, column - 8 : column + 9]
        found.append(
            [(window * columns).sum() / window.sum(), (window * (2 * rows + parity)).sum() / window.sum()]
        )
    return np.array(found)


@pytest.mark.parametrize("field", [0, 1])
@pytest.mark.parametrize("reflections", [1, 2])
@pytest.mark.parametrize("integration", [True, False])
def test_targets_are_found_where_the_truth_has_them(
    world: MakeWorld, shot: Shoot, field: int, reflections: int, integration: bool
) -> None:
    rig = {"reflections": reflections, "mirror_error_px": 0.3}
    made = world({"field_integration": integration}, scene="accuracy_object", rig=rig)
    luma, truth = shot(made, field), made.truth(field * 20_000_000)
    for places, visible in ((truth.left_px, truth.visible_left), (truth.right_px, truth.visible_right)):
        assert visible.sum() > 55
        assert_allclose(centroids(luma, field % 2, places[visible]), places[visible], atol=0.02)


def test_the_rows_of_a_frame_line_belong_to_alternate_fields(world: MakeWorld, shot: Shoot) -> None:
    made = world(**SPREAD_OUT)
    places = made.truth(0).left_px
    top, bottom = (centroids(shot(made, field), field, places) for field in (0, 1))
    assert_allclose(top, bottom, atol=0.02)


def test_noise_and_jitter_are_drawn_anew_for_every_field_and_again_alike(
    world: MakeWorld, shot: Shoot
) -> None:
    made, again = (world({"noise": 0.02, "jitter_px": 0.12}, scene="calibration_frame") for _ in range(2))
    assert (shot(made, 4) != shot(made, 6)).mean() > 0.5
    assert (shot(made, 4) == shot(again, 4)).all()
    other = world({"noise": 0.02, "jitter_px": 0.12}, scene="calibration_frame", seed=1)
    assert (shot(made, 4) != shot(other, 4)).mean() > 0.5


def test_line_jitter_moves_targets_along_the_lines_only(world: MakeWorld, shot: Shoot) -> None:
    still, shaken = (world({"jitter_px": jitter}, scene="calibration_frame") for jitter in (0.0, 0.3))
    places = still.truth(0).left_px
    moved = centroids(shot(shaken), 0, places) - centroids(shot(still), 0, places)
    assert 0.1 < moved[:, 0].std() < 0.25
    assert moved[:, 1].std() < 0.05


def test_targets_on_the_same_lines_share_their_jitter_in_both_halves(world: MakeWorld, shot: Shoot) -> None:
    points = [
        {"id": i, "x_mm": x, "y_mm": y, "z_mm": 0} for i, (x, y) in enumerate([(5, -9), (5, 9), (-20, 0)])
    ]
    still, shaken = (world({"jitter_px": j}, scene="points", points=points) for j in (0.0, 0.4))
    moved = []
    for field in range(0, 60, 2):
        truth = still.truth(0)
        places = np.concatenate([truth.left_px, truth.right_px])
        moved.append((centroids(shot(shaken, field), 0, places) - centroids(shot(still), 0, places))[:, 0])
    correlation = np.corrcoef(np.array(moved).T)
    assert correlation[0, 3] > 0.5
    assert abs(correlation[0, 2]) < 0.5


FAST = {"scene": "ellipse", "ellipse": {"deflection_mm": 8, "opening": 0.05}, "rig": {"mirror_error_px": 0}}
"""An ellipse that opens so fast that its middle moves several pixels in a field; field 1 is amid it."""


def test_exposure_smears_what_moves_along_its_way(world: MakeWorld, shot: Shoot) -> None:
    short, long = (world({"exposure_ms": ms}, **FAST) for ms in (0.0, 16.0))
    x, y = short.truth(20_000_000).left_px[8 * 6 + 3]
    row, column = round((y - 1) / 2), round(x)
    columns = np.arange(column - 10, column + 11)

    def spread(made: World) -> float:
        light = shot(made, 1)[row - 5 : row + 6, column - 10 : column + 11].astype(float) - 20
        return float((light * (columns - x) ** 2).sum() / light.sum())

    ends = [short.truth(time).left_px[8 * 6 + 3, 0] for time in (12_000_000, 28_000_000)]
    assert abs(ends[1] - ends[0]) > 3
    assert spread(long) - spread(short) == pytest.approx((ends[1] - ends[0]) ** 2 / 12, rel=0.1)


def test_exposure_neither_adds_light_nor_touches_what_stands_still(world: MakeWorld, shot: Shoot) -> None:
    moving, still = ([shot(world({"exposure_ms": ms}, **FAST), n) for ms in (0.0, 16.0)] for n in (1, 20))
    assert float(moving[0].sum()) == pytest.approx(float(moving[1].sum()), rel=1e-3)
    assert (moving[0] != moving[1]).any()
    assert (still[0] == still[1]).all()


def test_the_truth_is_that_of_the_middle_of_the_exposure(world: MakeWorld, shot: Shoot) -> None:
    made = world({"exposure_ms": 8.0})
    truth = made.truth(4 * 20_000_000)
    isolated = truth.visible_left & (made.scene.column >= 1) & (made.scene.column <= 3)
    found = centroids(shot(made, 4), 0, truth.left_px[isolated])
    assert_allclose(found, truth.left_px[isolated], atol=0.05)


def test_the_truth_follows_the_clock_alone(world: MakeWorld) -> None:
    truth = world().truth(123_456_789)
    assert_allclose(truth.xyz_mm, world(pace="free", buffers=3).truth(5_123_456_789).xyz_mm, atol=0)
    assert len(truth.ids) == len(truth.xyz_mm) == len(truth.left_px) == len(truth.visible_right) == 108


def test_all_of_the_calibration_frame_is_seen_in_both_views_and_well_inside(world: MakeWorld) -> None:
    for reflections in (1, 2):
        truth = world(scene="calibration_frame", rig={"reflections": reflections}).truth(0)
        assert truth.visible_left.all()
        assert truth.visible_right.all()
        x, y = np.concatenate([truth.left_px, truth.right_px - [360, 0]]).T
        assert 10 < x.min() < x.max() < 350
        assert 20 < y.min() < y.max() < 556


def test_targets_of_the_liner_vanish_behind_its_curve_and_come_back(world: MakeWorld) -> None:
    made = world()
    seen = np.array([made.truth(t * 20_000_000).visible_left for t in range(50)])
    assert 60 < seen.sum(axis=1).min() < seen.sum(axis=1).max() < 108
    assert (seen.any(axis=0) & ~seen.all(axis=0)).any()


def test_what_a_view_does_not_see_is_not_in_its_picture(world: MakeWorld, shot: Shoot) -> None:
    averted = {"id": 1, "x_mm": 0, "y_mm": 0, "z_mm": 0, "ny": -1.0, "nz": 0.4}
    made = world(scene="points", points=[averted])
    truth, luma = made.truth(0), shot(made)
    assert (truth.visible_left[0], truth.visible_right[0]) == (True, False)
    assert luma[:, :360].max() > 60
    assert luma[:, 360:].max() == 20


def test_a_blank_scene_shows_the_background(world: MakeWorld, shot: Shoot) -> None:
    assert set(shot(world(scene="blank")).ravel().tolist()) == {20}


def test_every_field_is_stamped_with_its_number_unless_told_not_to(world: MakeWorld, shot: Shoot) -> None:
    made = world({"stamp": True, "noise": 0.1}, scene="calibration_frame")
    assert [read_stamp(shot(made, field)) for field in (0, 7, 50)] == [(0, 0), (7, 1), (50, 0)]
    assert read_stamp(shot(world(scene="calibration_frame"), 7)) is None


def test_all_effects_together_give_a_picture(shot: Shoot) -> None:
    picture = {
        "gamma": 0.6,
        "agc_level": 60.0,
        "uneven_light": 0.4,
        "exposure_ms": 10,
        "noise": 0.1,
        "jitter_px": 0.4,
    }
    luma = shot(World(FakeOptions.read({"picture": picture})), 3)
    assert luma.std() > 5
