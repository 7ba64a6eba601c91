"""The sharpness of the targets' edges tells where a lens is in focus, however bright the picture is."""

import numpy as np
import pytest

from core.chain.fake_scene import take_scene
from grabberd.core.chain.light import CLIPPED_LEVEL, edge_sharpness, light_of
from grabberd.core.field import Field

VIEWS = {"left": (0, 360), "right": (360, 720)}
SPREADS_PX = (0.3, 0.5, 0.8, 1.2, 1.8, 2.5)
THRESHOLD = 60


def simulated(spread_px: float, seed: int = 1) -> Field:
    """A field of the liner through a lens whose blur is known."""
    picture = {"spread_x_px": spread_px, "spread_y_px": spread_px}
    field: Field = take_scene(1, scene="liner", picture=picture, seed=seed).fields[0][1]
    return field


def sharpness_of(field: Field, threshold: int = THRESHOLD) -> list[float]:
    """That of both views."""
    found = [light.sharpness for light in light_of(field, threshold, VIEWS).values()]
    assert None not in found
    return [one for one in found if one is not None]


def test_it_rises_with_every_step_toward_the_best_focus_and_falls_behind_it() -> None:
    through_the_focus = [*reversed(SPREADS_PX), *SPREADS_PX[1:]]
    found = np.array([sharpness_of(simulated(spread_px)) for spread_px in through_the_focus])
    best = len(SPREADS_PX) - 1
    assert (np.diff(found[: best + 1], axis=0) > 0.02).all()
    assert (np.diff(found[best:], axis=0) < -0.02).all()


def test_it_is_one_for_edges_that_only_the_pixels_blur_and_far_less_for_a_lens_far_off() -> None:
    assert min(sharpness_of(simulated(0.3))) > 0.75
    assert max(sharpness_of(simulated(2.5))) < 0.3


@pytest.mark.parametrize(("factor", "background"), [(0.6, 0), (0.8, 20), (1.1, 10)])
@pytest.mark.parametrize("spread_px", [0.5, 1.2])
def test_it_is_the_same_for_a_darker_lamp_and_a_lighter_background(
    spread_px: float, factor: float, background: int
) -> None:
    field = simulated(spread_px)
    luma = np.clip(field.luma * factor + background, 0, 255).astype(np.uint8)
    other = Field(luma, field.parity, field.y0, field.y_step)
    threshold = int(THRESHOLD * factor + background)
    assert sharpness_of(other, threshold) == pytest.approx(sharpness_of(field), abs=0.03)


def test_it_scatters_less_from_field_to_field_than_a_small_turn_of_the_lens_changes_it() -> None:
    found = np.array([sharpness_of(simulated(0.8, seed)) for seed in range(8)])
    assert found.std(axis=0).max() < 0.015


def test_targets_that_are_clipped_are_not_judged_by_the_edge_that_is_left_of_them() -> None:
    field = simulated(1.2)
    luma = np.clip(field.luma.astype(int) * 4, 0, 255).astype(np.uint8)
    clipped = light_of(Field(luma, field.parity, field.y0, 2), 150, VIEWS)["left"]
    assert clipped.clipped > 0.3
    assert clipped.sharpness is None or clipped.sharpness < sharpness_of(field)[0] + 0.1


def test_a_few_spots_or_none_are_not_judged() -> None:
    field = Field.intact(np.full((288, 720), 20, np.uint8), 0)
    assert edge_sharpness(field, np.zeros((0, 2)), 6.0, CLIPPED_LEVEL) is None
    assert edge_sharpness(field, np.array([[100.0, 100.0]]), 6.0, CLIPPED_LEVEL) is None
    assert edge_sharpness(field, np.full((9, 2), 100.0), 6.0, CLIPPED_LEVEL) is None
