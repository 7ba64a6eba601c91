"""Light into grey values."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from grabberd_fake.options import PictureOptions
from grabberd_fake.render import SCALE, Sensor, normal_distribution, normal_integral, normal_quantiles


def exposed(canvas: float = 0.0, fields: int = 1, seed: int = 0, **picture: Any) -> NDArray[np.uint8]:
    """The last of some fields of one even brightness above the background."""
    sensor = Sensor(PictureOptions(**{"noise": 0.0, **picture}))
    luma = np.empty((288, 720), np.uint8)
    for field in range(fields):
        rng = np.random.Generator(np.random.SFC64([seed, field]))
        sensor.expose(np.full((288, 2, 360), round(canvas * SCALE), np.int16), rng, luma)
    return luma


def test_without_noise_the_background_is_flat() -> None:
    assert set(exposed(background=20.0).ravel().tolist()) == {20}
    assert set(exposed(190.0, background=20.0).ravel().tolist()) == {210}


@pytest.mark.parametrize("noise", [0.02, 0.1])
def test_noise_has_its_size_and_no_mean(noise: float) -> None:
    luma = exposed(noise=noise, background=110.0, contrast=190.0).astype(float)
    assert luma.std() == pytest.approx(np.hypot(190 * noise, 12**-0.5), rel=0.01)
    assert luma.mean() == pytest.approx(110, abs=0.2)


def test_noise_is_white_over_the_picture() -> None:
    luma = exposed(noise=0.05, background=120.0).astype(float) - 120
    for one, other in ((luma[:, 1:], luma[:, :-1]), (luma[1:], luma[:-1]), (luma[:, :360], luma[:, 360:])):
        assert abs((one * other).mean()) < 0.02 * luma.var()


def test_noise_is_another_in_every_field_and_with_every_seed() -> None:
    first, second, other = exposed(noise=0.1), exposed(noise=0.1, fields=2), exposed(noise=0.1, seed=1)
    assert (first != second).mean() > 0.8
    assert (first != other).mean() > 0.8
    assert (first == exposed(noise=0.1)).all()


def test_bright_and_dark_are_clipped() -> None:
    assert exposed(280.0).max() == 255
    assert exposed(noise=0.2, background=0.0).min() == 0


@pytest.mark.parametrize("gamma", [0.45, 1.0, 2.2])
def test_gamma_bends_the_response(gamma: float) -> None:
    for light in (20.0, 100.0, 235.0):
        luma = exposed(light - 20, gamma=gamma)
        assert luma[0, 0] == pytest.approx(255 * (light / 255) ** gamma, abs=0.5)


def test_uneven_light_is_brighter_at_the_top_left_and_leaves_the_middle() -> None:
    luma = exposed(80.0, uneven_light=0.3, background=20.0).astype(float)
    assert luma[0, 0] == pytest.approx(130, abs=1)
    assert luma[-1, -1] == pytest.approx(70, abs=1)
    assert luma[144, 360] == pytest.approx(100, abs=1)
    assert np.abs(np.diff(luma, axis=1)).max() <= 1


def test_uneven_light_does_not_touch_the_noise() -> None:
    luma = exposed(80.0, uneven_light=0.3, noise=0.05).astype(float)
    still = exposed(80.0, uneven_light=0.3).astype(float)
    assert (luma - still)[:100, :200].std() == pytest.approx((luma - still)[-100:, -200:].std(), rel=0.05)


def test_automatic_gain_brings_the_mean_to_its_level_in_its_time() -> None:
    one, some, many = (
        exposed(30.0, fields, agc_level=100.0, agc_fields=10).mean() for fields in (1, 10, 120)
    )
    assert one == pytest.approx(50, abs=1)
    assert 60 < some < 95
    assert many == pytest.approx(100, abs=2)


def test_automatic_gain_has_limits() -> None:
    assert exposed(0.0, 200, agc_level=250.0, agc_fields=2, background=20.0).mean() == pytest.approx(
        80, abs=2
    )


def test_the_normal_distribution_is_that_of_the_tables() -> None:
    assert_allclose(
        normal_distribution(np.array([-9.0, -1.96, 0.0, 1.0, 9.0])),
        [0, 0.0249979, 0.5, 0.8413447, 1],
        atol=1e-6,
    )
    z = np.linspace(-5, 5, 2001)
    assert_allclose(np.gradient(normal_integral(z), z)[1:-1], normal_distribution(z)[1:-1], atol=1e-5)


def test_quantiles_chosen_evenly_are_normal() -> None:
    quantiles = normal_quantiles()
    assert len(quantiles) == 65536
    assert quantiles.mean() == pytest.approx(0, abs=1e-6)
    assert quantiles.std() == pytest.approx(1, abs=1e-3)
    assert (quantiles**4).mean() == pytest.approx(3, abs=0.02)
