"""Promises of every locator to the rooms that use its blobs, as tests that a locator's own subclass."""

from typing import ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from grabberd.core.field import BOTTOM, PROGRESSIVE, TOP, Field, PackedField, double_lines, quantise
from grabberd.core.measurement import Blobs, LocationSettings, measure, seen_in
from grabberd.core.measurement.locators import Located, Locator
from grabberd.testing.drawn_discs import THRESHOLD, DrawnDiscs, draw_discs, draw_nothing, with_lamp

_NEAR_PX = 3.0
"""Distance within which a blob belongs to a place; the discs are 20 px apart and more."""
_LINES = (TOP, BOTTOM, PROGRESSIVE)
_SEEDS = (11, 12)


class LocatorContract:
    """The contract of `grabberd.core.measurement.locators`; a subclass has a fixture `locator`.

    Attributes:
        bits: Bit depths that the locator is for; with others it refuses.
        doubled: True if it takes fields whose missing lines were interpolated, too.
        rms_px: Error that it keeps below on discs of 5 to 6.4 px, in x and in y.
        bias_px: Mean error that it keeps below.
        saturated_px: Error that it keeps below on discs that are white in the middle.
        chi2: Least and greatest mean of (error / σ)² on such discs.
    """

    bits: ClassVar[tuple[int, ...]] = (8,)
    doubled: ClassVar[bool] = True
    rms_px: ClassVar[float] = 0.12
    bias_px: ClassVar[float] = 0.03
    saturated_px: ClassVar[float] = 0.15
    chi2: ClassVar[tuple[float, float]] = (0.7, 1.4)

    @pytest.fixture
    def locator(self) -> Locator:
        """The locator that is tested."""
        raise NotImplementedError("the test's class needs a fixture `locator` that returns the function")

    @pytest.fixture
    def settings(self, locator: Locator) -> LocationSettings:
        """Settings that choose the locator; lines of drawn discs do not shift."""
        return LocationSettings(method="under_test", locator=locator, line_jitter_px=0.0)

    @pytest.mark.parametrize("parity", _LINES)
    def test_the_centres_are_right(self, settings: LocationSettings, parity: int) -> None:
        for packed, drawn in self._drawn(parity):
            error, _ = _errors(measure(packed, None, settings), drawn)
            assert len(error) == len(drawn.places_px), "some discs were not found"
            assert np.abs(error.mean(axis=0)).max() < self.bias_px
            assert np.sqrt((error**2).mean(axis=0)).max() < self.rms_px

    @pytest.mark.parametrize("parity", _LINES)
    def test_its_sigma_holds(self, settings: LocationSettings, parity: int) -> None:
        for bits in self.bits:
            squares = []
            for seed in _SEEDS:
                drawn = draw_discs(parity, seed=seed)
                error, sigma = _errors(measure(quantise(drawn.field, bits, THRESHOLD), None, settings), drawn)
                assert (sigma > 0).all()
                squares.append((error / sigma) ** 2)
            least, most = self.chi2
            assert least < np.concatenate(squares).mean() < most

    def test_its_positions_are_in_the_order_of_the_components(
        self, locator: Locator, settings: LocationSettings
    ) -> None:
        for packed, _ in self._drawn(TOP):
            seen = seen_in(packed, settings)
            located = locator(seen)
            self._check_form(located, len(seen.shapes))
            assert np.abs(located.centres - seen.centroids)[seen.of_size].max() < 1.0

    def test_a_field_without_targets_has_no_blobs(self, locator: Locator, settings: LocationSettings) -> None:
        for packed in self._packed(draw_nothing()):
            self._check_form(locator(seen_in(packed, settings)), 0)
            assert len(measure(packed, None, settings)) == 0

    def test_discs_that_are_white_in_the_middle_are_located(self, settings: LocationSettings) -> None:
        drawn = draw_discs(contrast=500.0)
        for packed in self._packed(drawn.field, 130):
            error, sigma = _errors(measure(packed, None, settings), drawn)
            assert len(error) == len(drawn.places_px)
            assert np.sqrt((error**2).mean(axis=0)).max() < self.saturated_px
            assert np.isfinite(sigma).all()
            assert (sigma > 0).all()

    def test_what_is_no_target_changes_nothing(self, settings: LocationSettings) -> None:
        for (packed, drawn), beside in zip(
            self._drawn(TOP), self._packed(with_lamp(draw_discs().field)), strict=True
        ):
            alone, both = measure(packed, None, settings), measure(beside, None, settings)
            assert len(both) == len(alone) == len(drawn.places_px)
            assert np.abs(both.xy_px - alone.xy_px).max() < self.rms_px

    def test_the_same_field_gives_the_same_blobs(self, settings: LocationSettings) -> None:
        for packed, _ in self._drawn(TOP):
            before = packed.data.copy()
            first, second = measure(packed, None, settings), measure(packed, None, settings)
            assert first.xy_px.tobytes() == second.xy_px.tobytes()
            assert first.sigma_px.tobytes() == second.sigma_px.tobytes()
            assert (packed.data == before).all(), "it wrote into the field"

    def _packed(self, field: Field, threshold: int = THRESHOLD) -> list[PackedField]:
        """The field at every bit depth, and with its missing lines interpolated."""
        fields = [field]
        if self.doubled and field.parity != PROGRESSIVE:
            fields.append(double_lines(field))
        return [quantise(one, bits, threshold) for bits in self.bits for one in fields]

    def _drawn(self, parity: int) -> list[tuple[PackedField, DrawnDiscs]]:
        drawn = draw_discs(parity)
        return [(packed, drawn) for packed in self._packed(drawn.field)]

    @staticmethod
    def _check_form(located: Located, count: int) -> None:
        for array in (located.centres, located.sigma_px):
            assert array.shape == (count, 2)
            assert array.dtype == np.float64


def _errors(blobs: Blobs, drawn: DrawnDiscs) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(N, 2) located minus true place of every disc that was found, and its σ."""
    distance = np.hypot(*(blobs.xy_px[:, None] - drawn.places_px[None]).transpose(2, 0, 1))
    blob, near = distance.argmin(axis=0), distance.min(axis=0) < _NEAR_PX
    return blobs.xy_px[blob[near]] - drawn.places_px[near], blobs.sigma_px[blob[near]]
