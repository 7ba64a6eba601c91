"""How a field is lit: what an installer turns lamp and lens by."""

import numpy as np
import pytest

from core.chain.fake_scene import Scene, take_scene
from grabberd.core.chain.light import light_of
from grabberd.core.field import Field

VIEWS = {"left": (0, 360), "right": (360, 720)}


@pytest.fixture(scope="module")
def scene() -> Scene:
    return take_scene(1, scene="liner")


@pytest.fixture(scope="module")
def lit(scene: Scene) -> Field:
    """Its only field."""
    return scene.fields[0][1]


def test_every_pixel_of_a_view_is_counted_once(lit: Field) -> None:
    for light in light_of(lit, 90, VIEWS).values():
        assert light.histogram.shape == (256,)
        assert light.histogram.sum() == 288 * 360


def test_the_targets_of_each_view_are_counted_and_measured(scene: Scene, lit: Field) -> None:
    seen = scene.measured(1, "doubled")[0].blobs
    for name, light in light_of(lit, 70, VIEWS).items():
        first, end = VIEWS[name]
        own = (seen.xy_px[:, 0] >= first) & (seen.xy_px[:, 0] < end)
        assert light.targets == pytest.approx(own.sum(), rel=0.1)
        assert light.diameter_px == pytest.approx(np.sqrt(4 * seen.area_px[own] / np.pi).mean(), rel=0.2)


def test_a_higher_threshold_shows_smaller_targets(lit: Field) -> None:
    low, high = light_of(lit, 60, VIEWS)["left"], light_of(lit, 110, VIEWS)["left"]
    assert low.diameter_px is not None
    assert high.diameter_px is not None
    assert high.diameter_px < low.diameter_px


def test_a_lamp_that_is_too_strong_shows_as_clipped(lit: Field) -> None:
    bright = Field(np.where(lit.luma > 90, 255, lit.luma).astype(np.uint8), lit.parity, lit.y0, 2)
    assert light_of(bright, 90, VIEWS)["left"].clipped == 1.0
    assert light_of(lit, 90, VIEWS)["left"].clipped < 0.5


def test_a_dark_field_has_no_targets_and_no_size() -> None:
    light = light_of(Field.intact(np.zeros((288, 720), np.uint8), 0), 90, VIEWS)["right"]
    assert (light.targets, light.diameter_px, light.background, light.brightest) == (0, None, 0, 0)
    assert light.clipped == 0.0


def test_background_and_targets_are_told_apart() -> None:
    luma = np.full((288, 720), 20, np.uint8)
    luma[100:103, 100:106] = luma[100:103, 500:506] = 200
    light = light_of(Field.intact(luma, 0), 90, VIEWS)["left"]
    assert (light.targets, light.background) == (1, 20)
