"""From a packed field to its blobs (paper 3.5)."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from grabberd.field import PackedField
from grabberd.kernel import KERNEL
from grabberd.measurement.blobs import Blobs
from grabberd.measurement.compiled.binary import measure_compiled, takes
from grabberd.measurement.compiled.grey import measure_grey, takes_grey
from grabberd.measurement.labelling.labels import by_component
from grabberd.measurement.labelling.mask import target_bits
from grabberd.measurement.labelling.runs import find_runs
from grabberd.measurement.labelling.shapes import shapes_of
from grabberd.measurement.line_shifts.line_jitter import Steadied, steadied
from grabberd.measurement.locale.locale import locate_by_locale
from grabberd.measurement.locators.centroid import locate_by_centroid
from grabberd.measurement.locators.correlation import locate_by_correlation
from grabberd.measurement.locators.edge import locate_by_edge
from grabberd.measurement.locators.interpolation import locate_by_tian_huhns, locate_by_vernier
from grabberd.measurement.locators.locator import Located, Locator, Seen
from grabberd.measurement.locators.template import locate_by_template
from grabberd.measurement.locators.weighted import locate_by_weighted


def _locate_by_the_best(seen: Seen) -> Located:
    """The method that measured best on fields of so many bits."""
    return (locate_by_locale if seen.packed.bits == 1 else locate_by_template)(seen)


LOCATORS: Mapping[str, Locator] = MappingProxyType(
    {
        "automatic": _locate_by_the_best,
        "centroid": locate_by_centroid,
        "weighted": locate_by_weighted,
        "template": locate_by_template,
        "edge": locate_by_edge,
        "correlation": locate_by_correlation,
        "locale": locate_by_locale,
        "vernier": locate_by_vernier,
        "tian-huhns": locate_by_tian_huhns,
    }
)
"""The locators by name."""
METHODS = tuple(LOCATORS)


@dataclass(frozen=True, slots=True)
class LocationSettings:
    """How targets are located.

    Attributes:
        method: one of `METHODS`; "automatic" is the one that measured best for the field's bits, "locale" at
            1 bit and "template" with more; "weighted" is nearly as good as that in half its time; "centroid"
            weighs all pixels alike at 1 bit, and by g − T with more bits (paper eqs. 1, 2).
        min_diameter_px: blobs that are smaller than a disc of this diameter, in frame pixels, are no targets.
        max_diameter_px: neither are larger ones.
        noise_levels: standard deviation of a pixel in grey values; None: taken from each field's background.
        target_px: diameter of the targets' discs in frame pixels; None: from the field's own blobs.
        spread_px: standard deviation of the spread function, frame pixels.
        line_jitter_px: standard deviation of a field line's shift in x, frame pixels, as it is expected; 0:
            lines are not shifted.
        line_jitter_known: it is known well enough not to be estimated from each field's own shifts.
        line_shifts: whether the shifts are solved for, and their standard deviation with them; None: with
            more than 1 bit, where it takes a third off the error in space; at 1 bit it takes a thirtieth.

    Raises:
        ValueError: an unknown method, or limits that no blob can meet.
    """

    method: str = "automatic"
    min_diameter_px: float = 2.5
    max_diameter_px: float = 15.0
    noise_levels: float | None = None
    target_px: float | None = None
    spread_px: float = 0.8
    line_jitter_px: float = 0.12
    line_jitter_known: bool = False
    line_shifts: bool | None = None

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise ValueError(f"method {self.method!r} is none of {', '.join(METHODS)}")
        if not 0 <= self.min_diameter_px < self.max_diameter_px:
            limits = f"min_diameter_px {self.min_diameter_px} and max_diameter_px {self.max_diameter_px}"
            raise ValueError(f"no blob can meet {limits}")
        if self.target_px is not None and not self.target_px > 0:
            raise ValueError(f"target_px {self.target_px} is not positive")
        if not (self.spread_px > 0 and self.line_jitter_px >= 0):
            lengths = f"spread_px {self.spread_px} and line_jitter_px {self.line_jitter_px}"
            raise ValueError(f"{lengths} have to be positive")


def measure(packed: PackedField, windows: NDArray[np.float64] | None, settings: LocationSettings) -> Blobs:
    """The targets seen in a field, of both views, in the order of their first row and column.

    Args:
        packed: the field; with more than 1 bit, pixels above its `threshold` belong to targets.
        windows: (M, 4) float64 x0, y0, x1, y1 in frame pixels, edges included: only blobs whose centre lies
            in one of them are returned. None: all of them.
        settings: which blobs are targets, and how their centres are taken.

    Returns:
        Blobs in frame pixels, whatever the field's parity and bits; none where nothing exceeds the threshold.
    """
    if KERNEL and takes(packed, settings):
        blobs = measure_compiled(KERNEL, packed, settings)
    elif KERNEL and takes_grey(packed, settings):
        blobs = measure_grey(KERNEL, packed, settings)
    else:
        blobs = measure_by_numpy(packed, settings)
    return blobs if windows is None else blobs.select(_inside(blobs, windows))


def measure_by_numpy(packed: PackedField, settings: LocationSettings) -> Blobs:
    """All targets seen in a field, for any method and any number of bits: what the kernel has to equal."""
    runs, label, count = by_component(find_runs(target_bits(packed)))
    seen = Seen(packed, runs, label, shapes_of(runs, label, count), settings)
    located = LOCATORS[settings.method](seen)
    return _in_frame(seen, located.sigma_px, steadied(seen, located)).select(seen.of_size)


def _in_frame(seen: Seen, sigma_px: NDArray[np.float64], steady: Steadied) -> Blobs:
    packed, shapes = seen.packed, seen.shapes
    return Blobs(
        xy_px=steady.centres * (1.0, packed.y_step) + (0.0, packed.y0),
        sigma_px=sigma_px,
        common_px=steady.common_px,
        area_px=seen.area_px,
        width_px=(shapes.last_column - shapes.first_column + 1).astype(np.float64),
        height_px=(shapes.last_row - shapes.first_row + 1).astype(np.float64) * packed.y_step,
        at_border=shapes.touch_border(packed.rows, packed.columns),
        common_reach_px=steady.common_reach_px,
        line_jitter_px=steady.line_jitter_px,
    )


def _inside(blobs: Blobs, windows: NDArray[np.float64]) -> NDArray[np.bool_]:
    x, y = blobs.xy_px.T[:, :, np.newaxis]
    x0, y0, x1, y1 = np.asarray(windows, np.float64).reshape(-1, 4).T
    found: NDArray[np.bool_] = ((x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)).any(axis=1)
    return found
