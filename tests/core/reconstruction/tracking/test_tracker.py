from dataclasses import fields

import numpy as np
import pytest

from core.geometry.rigs import calibration
from core.reconstruction.liners import model, see, wall
from grabberd.core.geometry import Rig
from grabberd.core.reconstruction import ImageNoise, Tracker, ViewBlobs

FIELD_S = 0.02
MODEL = model()
NOTHING = ViewBlobs(np.empty((0, 2)), np.empty((0, 2)))


def tracker(handedness=1) -> Tracker:
    rig = Rig.of(calibration(handedness))
    return Tracker(rig, MODEL, ImageNoise.of(rig, MODEL, 0.12, 2))


TRACKER = tracker()


def deflection_mm(field: int) -> float:
    """Six millimetres in seven fields, up to 1.3 mm in one; open again after ten."""
    phase = field % 30
    share = np.clip((phase - 3) / 7, 0, 1) - np.clip((phase - 20) / 7, 0, 1)
    return float(6.0 * (0.5 - 0.5 * np.cos(np.pi * share)))


def pulsation(count, seed=0, first=0, **changes):
    rng = np.random.default_rng(seed)
    return [see(*wall(deflection_mm(field)), rng, **changes) for field in range(first, first + count)]


def follow(scenes, rules=TRACKER, dt_s=FIELD_S):
    """The points of every scene, and the track after it."""
    track, results = rules.start(), []
    for seen in scenes:
        track, points = rules.step(track, seen.left, seen.right, dt_s)
        results.append((seen, points, track))
    return results


def identities(seen, points):
    """What the two blobs of every point really are."""
    of_left = {tuple(place): index for place, index in zip(seen.left.xy_px, seen.left_is, strict=True)}
    of_right = {tuple(place): index for place, index in zip(seen.right.xy_px, seen.right_is, strict=True)}
    pairs = [(of_left[tuple(left)], of_right[tuple(right)]) for left, right in points.image_px]
    return np.array(pairs, int).reshape(-1, 2)


def test_ids_stay_through_a_pulsation():
    for seen, points, _ in follow(pulsation(30, noise=0.1, missing=0.0, false=0.0)):
        assert (identities(seen, points) == points.target[:, np.newaxis] - 1).all()
        assert len(points) >= 0.96 * len(seen.visible)


def test_nearly_all_are_followed_and_none_wrongly_with_noise_missing_targets_and_false_blobs():
    visible = right = false = 0
    for seen, points, _ in follow(pulsation(60, seed=1)):
        index = points.target - 1
        real = identities(seen, points)
        correct = (real == index[:, np.newaxis]).all(axis=1)
        assert ((real == index[:, np.newaxis]) | (real == -1)).all()
        assert np.abs(points.xyz_mm - seen.xyz[index]).max() < 1.5
        visible, right, false = visible + len(seen.visible), right + correct.sum(), false + (~correct).sum()
    assert right >= 0.99 * visible
    assert false <= 0.002 * visible


def test_points_are_as_near_to_the_truth_as_their_covariance_says():
    chi2 = []
    for seen, points, _ in follow(pulsation(20, seed=2, noise=1.0, false=0.0))[1:]:
        error = (points.xyz_mm - seen.xyz[points.target - 1])[:, :, np.newaxis]
        jitterless = points.covariance_mm2
        chi2.append((error.swapaxes(1, 2) @ np.linalg.solve(jitterless, error)).mean() / 3)
    assert 0.6 < np.mean(chi2) < 1.1


def test_a_liner_that_starts_and_moves_two_millimetres_a_field_is_followed():
    depths = (0.0, 2.0, 4.0, 6.0, 6.0, 4.0, 2.0, 0.0, 0.0)
    rng = np.random.default_rng(3)
    scenes = [see(*wall(depth), rng, missing=0.0, false=0.0) for depth in depths]
    for seen, points, track in follow(scenes):
        assert (identities(seen, points) == points.target[:, np.newaxis] - 1).all()
        assert track.found >= 0.97 * len(seen.visible)


def test_a_wall_that_stops_at_once_is_identified_anew_and_keeps_its_velocity():
    depths = (0.0, 2.0, 4.0, 6.0, 6.0)
    rng = np.random.default_rng(17)
    scenes = [see(*wall(depth), rng, noise=0.5, missing=0.0, false=0.0) for depth in depths]
    results = follow(scenes)
    for seen, points, _ in results:
        assert (identities(seen, points) == points.target[:, np.newaxis] - 1).all()
        assert len(points) >= 0.97 * len(seen.visible)
    moving, stopped = (results[field][2].velocity_mm_s[:, 2].min() for field in (3, 4))
    assert moving < -85.0
    assert stopped > -40.0


def test_velocities_are_those_of_the_wall():
    *_, (_, _, before), (_, _, track) = follow(pulsation(8, noise=0.1, missing=0.0, false=0.0))
    true = (wall(deflection_mm(7))[0] - wall(deflection_mm(6))[0]) / FIELD_S
    seen_twice = (before.unseen_s == 0) & (track.unseen_s == 0)
    assert np.abs(track.velocity_mm_s - true)[seen_twice].max() < 5.0


def test_a_target_that_is_found_again_moves_as_the_others_do():
    scenes = pulsation(4, noise=0.1, missing=0.0, false=0.0)[:1] * 4
    hidden = scenes[0].left.select(~np.isin(scenes[0].left_is, [50, 56]))
    track = follow(scenes[:2])[-1][2]
    track, _ = TRACKER.step(track, hidden, scenes[0].right, FIELD_S)
    assert (track.unseen_s[[50, 56]] > 0).all()
    track, _ = TRACKER.step(track, scenes[0].left, scenes[0].right, FIELD_S)
    assert (track.unseen_s[[50, 56]] == 0).all()
    assert np.abs(track.velocity_mm_s[[50, 56]]).max() < 0.5


def test_targets_that_vanish_come_back_under_their_ids():
    scenes = pulsation(14, seed=4, noise=0.5, missing=0.0, false=0.0)
    hidden = np.arange(40, 64)
    for seen in scenes[4:9]:
        seen.left.xy_px[np.isin(seen.left_is, hidden)] = [5.0, 5.0]
    results = follow(scenes)
    for seen, points, track in results[4:9]:
        assert not np.isin(points.target - 1, hidden).any()
        off = np.linalg.norm(track.xyz_mm - seen.xyz, axis=1)[hidden]
        assert (off < 5 * track.sigma_mm[hidden] + 0.3).all()
    assert results[8][2].unseen_s[45] == pytest.approx(5 * FIELD_S)
    seen, points, track = results[-1]
    assert (identities(seen, points) == points.target[:, np.newaxis] - 1).all()
    assert set(hidden.tolist()) & seen.visible <= set((points.target - 1).tolist())
    assert track.unseen_s[45] == 0.0


def test_a_stray_blob_where_a_long_hidden_target_may_be_is_not_given_out_at_once():
    scenes = pulsation(3, noise=0.1, missing=0.0, false=0.0)
    results = follow(scenes)
    track = results[-1][2]
    column = np.flatnonzero(MODEL.column == 5)
    assert (track.unseen_s[column] > 0).all()
    seen = see(*wall(deflection_mm(3)), np.random.default_rng(5), noise=0.1, missing=0.0, false=0.0)
    place = TRACKER.correspondence.predict(track.xyz_mm, track.sigma_mm, 0.2).image_px[:, 0, 53] + [3.0, 0.3]
    left = ViewBlobs(np.vstack([seen.left.xy_px, place]), np.vstack([seen.left.sigma_px, [0.2, 0.2]]))
    _, points = TRACKER.step(track, left, seen.right, FIELD_S)
    assert 54 not in points.target


@pytest.mark.parametrize("gap", [2, 3])
def test_lost_fields_are_bridged(gap):
    scenes = pulsation(30, seed=6, noise=0.5, missing=0.0, false=0.0)[::gap]
    for seen, points, track in follow(scenes, dt_s=gap * FIELD_S):
        assert (identities(seen, points) == points.target[:, np.newaxis] - 1).all()
        assert track.found >= 0.95 * len(seen.visible)


def test_after_a_long_gap_targets_are_identified_anew():
    results = follow(pulsation(3, seed=7))
    track = results[-1][2]
    seen = pulsation(1, seed=8, first=12)[0]
    after, points = TRACKER.step(track, seen.left, seen.right, 10.0)
    assert len(points) >= 0.97 * len(seen.visible)
    assert not after.velocity_mm_s.any()


def test_when_most_targets_jump_they_are_identified_anew_at_once():
    rng = np.random.default_rng(9)
    rest, collapsed = (see(*wall(depth), rng, missing=0.0, false=0.0) for depth in (0.0, 6.0))
    track = follow([rest, rest])[-1][2]
    down = np.array([0.0, 9.0])
    left, right = (ViewBlobs(view.xy_px + down, view.sigma_px) for view in (collapsed.left, collapsed.right))
    after, points = TRACKER.step(track, left, right, FIELD_S)
    assert len(points) >= 0.9 * len(collapsed.visible)
    assert after.age_s == 0.0


def test_dark_fields_give_no_points_and_the_track_goes_on_behind_them():
    results = follow(pulsation(4, seed=10))
    track, dark = results[-1][2], None
    for _ in range(2):
        track, dark = TRACKER.step(track, NOTHING, NOTHING, FIELD_S)
        assert len(dark) == 0
    assert track.age_s == pytest.approx(2 * FIELD_S)
    seen = pulsation(1, seed=11, first=6)[0]
    track, _ = TRACKER.step(track, seen.left, seen.right, FIELD_S)
    assert track.found >= 0.95 * len(seen.visible)
    assert track.age_s == 0.0


def test_a_step_changes_nothing_of_the_track_before():
    scenes = pulsation(3, seed=14)
    track = follow(scenes[:2])[-1][2]
    before = {f.name: np.copy(getattr(track, f.name)) for f in fields(track)}
    TRACKER.step(track, scenes[2].left, scenes[2].right, FIELD_S)
    for name, value in before.items():
        assert np.array_equal(getattr(track, name), value)


def test_the_same_fields_give_the_same_points_bit_for_bit():
    scenes = pulsation(6, seed=15)
    for (_, first, _), (_, second, _) in zip(follow(scenes), follow(scenes, tracker()), strict=True):
        assert first.target.tobytes() == second.target.tobytes()
        assert first.xyz_mm.tobytes() == second.xyz_mm.tobytes()
        assert first.covariance_mm2.tobytes() == second.covariance_mm2.tobytes()


def test_a_left_handed_rig_is_tracked_alike():
    rig = calibration(-1)
    for seen, points, track in follow(pulsation(5, seed=16, rig=rig), tracker(-1)):
        real = identities(seen, points)
        assert ((real == points.target[:, np.newaxis] - 1) | (real == -1)).all()
        assert track.found >= 0.95 * len(seen.visible)


@pytest.mark.parametrize("lost", [0.0, 0.2])
@pytest.mark.parametrize("stroke_mm", [5.0, 8.0, 10.0])
@pytest.mark.parametrize("seconds", [0.02, 0.04, 0.09, 0.15])
def test_closures_are_followed_and_no_target_takes_anothers_place(seconds, stroke_mm, lost):
    rng = np.random.default_rng((round(1000 * seconds), round(stroke_mm)))
    track, before_s, visible, right = TRACKER.start(), -np.inf, 0, 0
    for field in range(60):
        time_s = field * FIELD_S
        part = np.clip((time_s % 0.61 - 0.113) / seconds, 0, 1) - np.clip(
            (time_s % 0.61 - 0.37) / seconds, 0, 1
        )
        seen = see(*wall(round(stroke_mm * part, 2)), rng, noise=0.5, missing=0.0, false=0.0)
        if rng.random() < lost:
            continue
        track, points = TRACKER.step(track, seen.left, seen.right, time_s - before_s)
        assert (identities(seen, points) == points.target[:, np.newaxis] - 1).all()
        before_s, visible, right = time_s, visible + len(seen.visible), right + len(points)
    assert right >= 0.999 * visible
