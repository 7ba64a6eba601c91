"""The light in the simulated picture."""

import numpy as np
import pytest

from grabberd_fake import FakeOptions
from grabberd_fake.light_options import LightOptions, lit, share_lit
from grabberd_fake.world import World

LIGHT = LightOptions(diameter_px=10.0)


def test_its_pattern_is_of_chance_and_never_repeats() -> None:
    states = lit(LIGHT, np.arange(4000) * 92_361_000 + 1)
    assert states.mean() == pytest.approx(0.5, abs=0.05)
    signs = np.where(states, 1.0, -1.0)
    alike = [abs(np.mean(signs[lag:] * signs[:-lag])) for lag in range(1, 2000)]
    assert max(alike) < 0.12


def test_it_changes_with_the_bits_alone() -> None:
    states = lit(LIGHT, np.arange(0, 5_000_000_000, 1_000_000))
    changes = np.flatnonzero(np.diff(states))
    assert len(changes) > 10
    assert (np.abs(((changes + 1) / 92.361) - np.rint((changes + 0.5) / 92.361)) < 0.02).all()


def test_an_exposure_counts_the_time_for_which_it_is_on() -> None:
    edge_ns = (
        next(
            k for k in range(1, 100) if (lit(LIGHT, np.array([k, k - 1]) * 92_361_000) == [True, False]).all()
        )
        * 92_361_000
    )
    assert share_lit(LIGHT, edge_ns, 1_000_000) == pytest.approx(0.5, abs=1e-3)
    assert share_lit(LIGHT, edge_ns + 250_000, 1_000_000) == pytest.approx(0.75, abs=1e-3)
    assert share_lit(LIGHT, edge_ns + 600_000, 1_000_000) == 1.0
    assert share_lit(LIGHT, edge_ns - 600_000, 1_000_000) == 0.0


def test_the_picture_shows_it_and_nothing_else_changes() -> None:
    dark, bright = (World(FakeOptions.read({"light": {"diameter_px": diameter}})) for diameter in (0.0, 10.0))
    shares = [share_lit(LIGHT, field * 20_000_000, 1_000_000) for field in range(60)]
    one, other = np.empty((288, 720), np.uint8), np.empty((288, 720), np.uint8)
    for field in (shares.index(1.0), shares.index(0.0)):
        dark.picture(field, one)
        bright.picture(field, other)
        # A window as wide as the light rounds the targets at other places.
        changed = np.argwhere(np.abs(one.astype(int) - other) > 30)
        if shares[field]:
            assert changed.mean(axis=0) == pytest.approx([550 / 2, 330], abs=1.0)
            assert other[275, 330] > one[275, 330] + 100
        else:
            assert not len(changed)


def test_it_has_to_lie_in_one_half() -> None:
    with pytest.raises(ValueError, match="one half of the picture"):
        FakeOptions.read({"light": {"diameter_px": 10.0, "x_px": 358.0}})
