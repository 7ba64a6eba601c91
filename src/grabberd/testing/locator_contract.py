"""Promises of every locator to the rooms that use its blobs, as tests that a locator's own subclass.

The fields are of discs at known places, drawn by OpenCV: no formula of the program's own is in them.
"""

from functools import lru_cache
from typing import ClassVar, NamedTuple

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from grabberd.core.field import BOTTOM, PROGRESSIVE, TOP, Field, PackedField, double_lines, quantise
from grabberd.core.measurement import Blobs, LocationSettings, measure, seen_in
from grabberd.core.measurement.locators import Located, Locator

FINE = 8
"""Samples of a drawn disc for a pixel, in x and in y."""
BACKGROUND, CONTRAST = 30, 150
THRESHOLD = BACKGROUND + CONTRAST // 2
WHITE = 255
_COLUMNS, _FRAME_LINES = 720, 576
_PITCH_PX = 26
_PATCH_PX = 16
_SPREAD_PX = 0.8


class DrawnDiscs(NamedTuple):
    """A field and what is in it.

    Attributes:
        field: The field.
        places_px: (N, 2) float64, true centres of the discs, frame pixels.
        noise: Standard deviation of a pixel, grey values.
    """

    field: Field
    places_px: NDArray[np.float64]
    noise: float


@lru_cache(maxsize=16)
def draw_discs(
    parity: int = TOP,
    *,
    seed: int = 1,
    diameters_px: tuple[float, float] = (5.0, 6.4),
    contrast: float = CONTRAST,
    noise: float = 3.0,
) -> DrawnDiscs:
    """Draw a grid of discs, each at a random place within its cell and of a random size.

    Args:
        parity: Lines of the field; `PROGRESSIVE` has all of them.
        seed: Of places, sizes and noise.
        diameters_px: Least and greatest diameter, frame pixels.
        contrast: Grey values of a disc's middle above the background, before it is cut off at white.
        noise: Standard deviation of a pixel, grey values.
    """
    rng = np.random.default_rng(seed)
    light = np.zeros((_FRAME_LINES, _COLUMNS))
    places = []
    for top in range(_PITCH_PX, _FRAME_LINES - 2 * _PITCH_PX, _PITCH_PX):
        for left in range(_PITCH_PX, _COLUMNS - 2 * _PITCH_PX, _PITCH_PX):
            centre = rng.integers(-FINE, FINE, 2, endpoint=True) + _PATCH_PX * FINE // 2
            light[top : top + _PATCH_PX, left : left + _PATCH_PX] += _disc(centre, rng.uniform(*diameters_px))
            # A pixel's middle lies between the two samples in the middle of its FINE.
            places.append((left, top) + (centre - (FINE - 1) / 2) / FINE)
    grey = BACKGROUND + contrast * light + rng.normal(0, noise, light.shape)
    luma = np.clip(np.rint(grey), 0, WHITE).astype(np.uint8)
    luma.setflags(write=False)  # whoever asks for the same again gets the same array
    return DrawnDiscs(field_of(luma, parity), np.array(places), noise)


def draw_nothing(parity: int = TOP, *, seed: int = 1, noise: float = 3.0) -> Field:
    """Draw the background alone."""
    grey = BACKGROUND + np.random.default_rng(seed).normal(0, noise, (_FRAME_LINES, _COLUMNS))
    return field_of(np.clip(np.rint(grey), 0, WHITE).astype(np.uint8), parity)


def with_lamp(field: Field) -> Field:
    """The same field with something large and white at its left edge, which is no target."""
    luma = field.luma.copy()
    luma[10 : 10 + luma.shape[0] // 3, :12] = WHITE
    return Field(luma, field.parity, field.y0, field.y_step)


def field_of(luma: NDArray[np.uint8], parity: int) -> Field:
    """The lines of a picture that belong to a field."""
    if parity == PROGRESSIVE:
        return Field.progressive(luma)
    assert parity in (TOP, BOTTOM)
    return Field.intact(np.ascontiguousarray(luma[parity::2]), parity)


def _disc(centre: NDArray[np.int64], diameter_px: float) -> NDArray[np.float64]:
    """A disc of brightness 1 through the lens's spread and square pixels, at a fine sample (x, y)."""
    fine = np.zeros((_PATCH_PX * FINE, _PATCH_PX * FINE), np.float32)
    cv2.circle(fine, (int(centre[0]), int(centre[1])), round(diameter_px / 2 * FINE), 1.0, cv2.FILLED)
    spread = cv2.GaussianBlur(fine, (0, 0), _SPREAD_PX * FINE)
    return cv2.resize(spread, (_PATCH_PX, _PATCH_PX), interpolation=cv2.INTER_AREA).astype(np.float64)


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
