"""The liner: targets on a solved wall that follows the vacuum."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from grabberd_fake.liner import Liner, movement, patch_places
from grabberd_fake.liner_options import LinerOptions
from grabberd_fake.options import FakeOptions
from grabberd_fake.wall_states import Patch, touch_kpa, wall_names, wall_states

OPEN_NS, CLOSED_NS = 400_000_000, 900_000_000
MS = 1_000_000


def options(**given: Any) -> LinerOptions:
    return FakeOptions.read({"liner": given}).liner


def heights_mm(scene: Liner, times_ns: np.ndarray) -> np.ndarray:
    """(T, N) of the targets."""
    return np.array([scene.targets(int(time_ns)).xyz_mm[:, 2] for time_ns in times_ns])


def test_it_has_18_rows_of_6_targets_numbered_from_one() -> None:
    scene = Liner(options())
    assert scene.ids.tolist() == list(range(1, 109))
    assert (scene.row.max(), scene.column.max()) == (17, 5)
    assert (scene.row[6], scene.column[6]) == (1, 0)


def test_nominal_shape_is_that_of_the_mounted_wall_on_whose_outer_face_the_targets_are_glued() -> None:
    scene = Liner(options(wall="reference-empty"))
    places = scene.nominal().xyz_mm.reshape(18, 6, 3)
    y, z = places[..., 1], places[..., 2] + 9.0
    assert_allclose(np.hypot(y, z), 13.75, atol=0.06)
    assert_allclose(np.diff(places[:, 0, 0]), 6.5, atol=0.02)
    assert_allclose(13.75 * np.diff(np.arctan2(y, z), axis=1), 6.5, atol=0.1)
    assert_allclose(places[8:10, :, 0].mean(axis=0), 0, atol=1e-6)


def test_open_it_stands_where_the_object_model_has_it() -> None:
    scene = Liner(options())
    assert_allclose(scene.targets(OPEN_NS).xyz_mm, scene.nominal().xyz_mm, atol=1e-9)


def test_targets_are_where_the_table_has_the_wall() -> None:
    chosen = options(wall="tapered-blunt", rows=3, columns=4, axis_z_mm=-5.0)
    states = wall_states("tapered-blunt")
    points, normals = Patch(states, *patch_places(chosen)).surface(states.outer_mm(42.0))
    shown = Liner(chosen).targets(CLOSED_NS)
    assert_allclose(shown.xyz_mm, points.reshape(-1, 3) + np.array([0, 0, -5.0]), atol=1e-9)
    assert_allclose(shown.normal, normals.reshape(-1, 3), atol=1e-9)


def test_thick_targets_stand_off_along_the_normal() -> None:
    plain, thick = (Liner(options(target_thickness_mm=t)).targets(CLOSED_NS) for t in (0.0, 0.2))
    assert_allclose(thick.xyz_mm - plain.xyz_mm, 0.2 * plain.normal, atol=1e-9)


def test_patch_farther_down_the_liner_shows_it_there() -> None:
    whole, part = Liner(options()), Liner(options(rows=3, patch_x_mm=3.25))
    rows = np.isin(whole.row, [8, 9, 10])
    expected = whole.targets(CLOSED_NS).xyz_mm[rows] - [3.25, 0, 0]
    assert_allclose(part.targets(CLOSED_NS).xyz_mm, expected, atol=1e-9)


@pytest.mark.parametrize("wall", wall_names())
def test_wall_closes_towards_its_axis_and_as_far_as_its_teat_lets_it(wall: str) -> None:
    scene = Liner(options(wall=wall, rows=5))
    middle = scene.column == 2
    sunk = (scene.nominal().xyz_mm - scene.targets(CLOSED_NS).xyz_mm)[middle, 2]
    assert sunk.min() > 0.5
    assert 4 < sunk.max() < 12.5


def test_every_period_is_like_the_one_before() -> None:
    scene = Liner(options(period_s=0.8, fastest_mm_per_s=100))
    for time_ns in (30 * MS, 130 * MS, 555 * MS):
        later = scene.targets(time_ns + 75 * 800 * MS).xyz_mm
        assert_allclose(scene.targets(time_ns).xyz_mm, later, atol=1e-9)


def test_default_liner_opens_and_closes_in_the_times_that_were_seen_on_real_ones() -> None:
    scene = Liner(options())
    at = heights_mm(scene, np.arange(0, 1000 * MS, MS))
    most = np.ptp(at, axis=0).argmax()
    open_ = (at[:, most] - at[:, most].min()) / np.ptp(at[:, most])
    assert 5 < np.ptp(at[:, most]) < 12
    opening_ms = int((open_[:500] < 0.9).sum() - (open_[:500] < 0.1).sum())
    closing_ms = int((open_[500:] > 0.1).sum() - (open_[500:] > 0.9).sum())
    assert 23 <= closing_ms <= 50
    assert 23 <= opening_ms <= 50


@pytest.mark.parametrize("wall", ["thin-empty", "reference-round"])
def test_wall_never_moves_faster_than_it_can(wall: str) -> None:
    steep = {"rising": 0.005, "open": 0.5, "falling": 0.005}
    scene = Liner(options(wall=wall, vacuum=steep, fastest_mm_per_s=300.0))
    places = np.array([scene.targets(k * MS).xyz_mm for k in range(1001)])
    speed = np.linalg.norm(np.diff(places, axis=0), axis=-1).max() * 1000
    assert 200 < speed < 320


def test_wall_that_is_fast_enough_shows_the_state_of_the_moment() -> None:
    slow = {"rising": 0.3, "open": 0.2, "falling": 0.3}
    moves = movement(options(period_s=10.0, vacuum=slow))
    for time_ns in range(0, 10_000 * MS, 37 * MS):
        assert moves.rest_kpa(time_ns) == moves.difference_kpa(time_ns)


def test_late_wall_lags_on_both_ways_and_rests_in_between() -> None:
    steep = {"rising": 0.005, "open": 0.5, "falling": 0.005}
    moves = movement(options(vacuum=steep, fastest_mm_per_s=150.0))
    assert moves.rest_kpa(10 * MS) > moves.difference_kpa(10 * MS) == 0
    assert moves.rest_kpa(515 * MS) < moves.difference_kpa(515 * MS) == 42
    assert moves.rest_kpa(400 * MS) == pytest.approx(0, abs=1e-9)
    assert moves.rest_kpa(900 * MS) == pytest.approx(42, abs=1e-9)


def test_slow_ramp_takes_the_empty_liner_through_its_touch_point() -> None:
    ramp = {"rising": 0.5, "open": 0.0, "falling": 0.5}
    chosen = options(wall="reference-empty", period_s=60.0, vacuum=ramp)
    moves, touch = movement(chosen), touch_kpa(wall_states("reference-empty"))
    times_ns = np.arange(30_000, 60_000, 250) * MS
    rest = np.array([moves.rest_kpa(int(t)) for t in times_ns])
    assert_allclose(np.diff(rest), 42 / 30 * 0.25, rtol=1e-6)
    middle = heights_mm(Liner(chosen), times_ns)[:, 8 * 6 + 2]
    falls = np.diff(middle)
    assert falls[(rest[1:] > touch - 4) & (rest[1:] < touch - 1)].max() < -0.2
    assert np.abs(falls[rest[1:] > touch + 2]).max() < 0.02


def test_short_exposure_finds_a_movement_even_after_months_of_clock() -> None:
    scene = Liner(options())
    month_ns = 30 * 86_400 * 1_000_000_000
    now, soon = (scene.targets(month_ns + 655 * MS + more).xyz_mm for more in (0, 1000))
    assert 1e-5 < np.abs(soon - now).max() < 1e-3
