"""The mean cycle of every target."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from grabberd.core.reconstruction import SingleViewImages
from grabberd.errors import AnalysisError
from grabberd_fake.liner import EllipseLiner
from grabberd_fake.liner_options import EllipseOptions
from grabberd_liner.analysis.pulsation.movement import first_movement
from grabberd_liner.analysis.pulsation.phase_average import phase_average
from grabberd_liner.analysis.pulsation.pulsation import fit_pulsation
from liner.analysis.pulsating import burst_times, capture, liner, times

PHASE = np.arange(0, 1, 0.05)


def average(*captures):
    pulsation = fit_pulsation(first_movement(captures))
    return phase_average(captures, pulsation, PHASE), pulsation


def errors(found, pulsation):
    """(P, N, 3) from the true places, and their σ."""
    scene, start_s = EllipseLiner(EllipseOptions()), pulsation.runs[0].start_s + 10
    true = [scene.targets(round((start_s + p * pulsation.period_s) * 1e9)).xyz_mm for p in found.phase]
    index = [points.target - 1 for points in found.points]
    off = [p.xyz_mm - t[i] for p, t, i in zip(found.points, true, index, strict=True)]
    return np.array(off), np.sqrt([np.einsum("nii->ni", p.covariance_mm2) for p in found.points])


def test_places_of_the_mean_cycle_are_true_within_their_sigma() -> None:
    off, sigma = errors(*average(capture(times(250), 0.03)))
    assert ((off / sigma) ** 2).mean() == pytest.approx(1.0, abs=0.15)


def test_a_movement_without_steep_flanks_has_places_true_within_their_sigma() -> None:
    smooth = {"opening": 0.49, "open": 0.01, "closing": 0.49}
    found, pulsation = average(capture(times(150), 0.03, **smooth))
    scene, start_s = EllipseLiner(liner(**smooth)), pulsation.runs[0].start_s + 10
    for phase, points in zip(found.phase, found.points, strict=True):
        true = scene.targets(round((start_s + phase * pulsation.period_s) * 1e9)).xyz_mm
        sigma = np.sqrt(np.einsum("nii->ni", points.covariance_mm2))
        assert (((points.xyz_mm - true[points.target - 1]) / sigma) ** 2).mean() < 1.4


def test_a_closed_wall_stands_still_though_it_closes_within_three_fields() -> None:
    """With the harmonics of single targets alone it would swing by .02 mm, all targets alike."""
    steep = {"opening": 0.06, "open": 0.44, "closing": 0.06, "deflection_mm": 5.0, "period_s": 0.97}
    fields = capture(times(100), 0.01, **steep)
    pulsation = fit_pulsation(first_movement([fields]))
    phase = np.arange(0.65, 0.95, 0.01)
    found = phase_average([fields], pulsation, phase)
    true = EllipseLiner(liner(**steep)).targets(round(0.8 * 0.97e9)).xyz_mm
    off = np.array([points.xyz_mm - true[points.target - 1] for points in found.points])
    assert np.abs(off.mean(axis=1)).max() < 0.005


def test_noise_falls_with_the_root_of_the_cycles() -> None:
    few, many = (errors(*average(capture(times(count), 0.05)))[0].std() for count in (150, 600))
    assert many / few == pytest.approx(0.5, abs=0.08)


def test_the_calibrations_covariance_is_not_averaged_away() -> None:
    found, _ = average(capture(times(250)))
    for points in found.points:
        assert_allclose(points.calibration_covariance_mm2, np.tile(np.eye(3) * 1e-4, (108, 1, 1)))
        assert np.isnan(points.image_px).all()


def test_it_is_the_same_from_bursts_put_together() -> None:
    starts_s = (0.0, 0.31, 0.55, 0.72, 1.9, 2.03)
    captures = [capture(time_s, 0.03, seed=k) for k, time_s in enumerate(burst_times(starts_s))]
    found, pulsation = average(*captures)
    off, sigma = errors(found, pulsation)
    assert ((off / sigma) ** 2).mean() == pytest.approx(1.0, abs=0.25)


def test_targets_that_are_missing_now_and_then_are_averaged_over_the_rest() -> None:
    found, pulsation = average(capture(times(300), 0.03, missing=0.3))
    off, sigma = errors(found, pulsation)
    assert ((off / sigma) ** 2).mean() == pytest.approx(1.0, abs=0.2)


def test_a_target_that_hides_in_a_part_of_the_cycle_is_left_out() -> None:
    fields = capture(times(250))
    hidden = [
        f._replace(points=f.points.select(f.points.target != 7)) if 0.3 < f.time_s % 1 < 0.6 else f
        for f in fields
    ]
    found, _ = average(hidden)
    assert all(7 not in points.target for points in found.points)
    assert len(found.points[0]) == 107


def test_cycles_that_differ_widen_sigma() -> None:
    fields = capture(times(300), 0.02)
    rng = np.random.default_rng(0)
    wobble = rng.normal(0, 0.1, 12).repeat(25)[:, None] * [0, 1.0, 0]
    moved = [
        f._replace(points=type(f.points)(f.points.target, f.points.xyz_mm + w, *_rest(f.points)))
        for f, w in zip(fields, wobble, strict=True)
    ]
    steady, wobbling = average(fields)[0], average(moved)[0]
    grown = [p.covariance_mm2[:, 1, 1].mean() for p in (steady.points[3], wobbling.points[3])]
    assert grown[1] > 2 * grown[0]


def _rest(points):
    return (points.covariance_mm2, points.calibration_covariance_mm2, points.image_px, points.residual_px)


def test_where_no_target_is_seen_all_round_nothing_is_made_up() -> None:
    fields = capture(times(250))
    pulsation = fit_pulsation(first_movement([fields]))
    half = [f for f in fields if f.time_s % 1 < 0.5]
    with pytest.raises(AnalysisError, match="no target is seen in the whole cycle"):
        phase_average([half], pulsation, PHASE)


def in_one_view(fields, target, sigma_px, seed=0):
    """The fields, had the right view alone seen a target whose image moves as its place does."""
    random, scene = np.random.default_rng(seed), EllipseLiner(EllipseOptions())
    changed = []
    for field in fields:
        image_px = image_of(scene, field.time_s, target) + random.normal(size=(1, 2)) * sigma_px
        single = SingleViewImages(
            np.array([target], np.int32), np.array([1]), image_px, np.full((1, 2), sigma_px)
        )
        rest = field.points.select(field.points.target != target)
        changed.append(field._replace(points=replace(rest, single=single)))
    return changed


def image_of(scene, time_s, target):
    """(1, 2) image in px of a camera far above."""
    place = scene.targets(round(time_s * 1e9)).xyz_mm[target - 1]
    return np.array([[540 + 4 * place[0], 280 + 4 * place[1] + 1.0 * place[2]]])


def test_a_target_that_one_view_alone_sees_has_a_mean_image_within_its_sigma() -> None:
    found, pulsation = average(in_one_view(capture(times(250), 0.03), 50, 0.1))
    scene, start_s = EllipseLiner(EllipseOptions()), pulsation.runs[0].start_s + 10
    ratio = []
    for phase, points in zip(found.phase, found.points, strict=True):
        assert points.single is not None
        assert points.single.target.tolist() == [50]
        assert points.single.view.tolist() == [1]
        true = image_of(scene, start_s + phase * pulsation.period_s, 50)
        ratio.append((points.single.image_px - true) / points.single.sigma_px)
        assert (points.single.sigma_px < 0.05).all()
    assert np.mean(np.square(ratio)) == pytest.approx(1.0, abs=0.6)


def test_images_count_also_where_the_target_has_a_point() -> None:
    fields = capture(times(250), 0.03)
    one_view = in_one_view(fields, 50, 0.1)
    scene = EllipseLiner(EllipseOptions())
    mixed = []
    for whole, alone in zip(fields, one_view, strict=True):
        of = whole.points.target == 50
        image_px = np.full((len(of), 2, 2), np.nan)
        image_px[of, 1] = image_of(scene, whole.time_s, 50)
        both = whole._replace(points=replace(whole.points, image_px=image_px))
        mixed.append(both if 0.3 < whole.time_s % 1 < 0.7 else alone)
    found, _ = average(mixed)
    assert all(50 in points.single.target for points in found.points if points.single)
    assert found.points[0].single is not None
    assert 50 not in found.points[0].target


def test_a_target_that_either_view_sees_throughout_without_a_point_is_left_out() -> None:
    fields = in_one_view(capture(times(250), 0.03), 50, 0.1)
    turned = [
        one._replace(points=replace(one.points, single=replace(one.points.single, view=np.array([k % 2]))))
        for k, one in enumerate(fields)
    ]
    found, _ = average(turned)
    assert all(points.single is None for points in found.points)
