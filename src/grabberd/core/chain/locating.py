"""Location over a run of fields, and the blobs of each view."""

import sys
from collections import deque
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import PackedField
from grabberd.core.geometry import LocalField, View
from grabberd.core.measurement import Blobs, LocationSettings, measure
from grabberd.core.measurement.location import settings_for
from grabberd.core.reconstruction import ViewBlobs

JITTERS, JITTER_EVERY = 9, 25
"""The line jitter is the median of the last nine estimates. It belongs to the equipment and hardly changes,
so that after the first nine fields only every 25th is used for a new estimate."""


class Locating:
    """Location of each field's blobs; line jitter, a property of the equipment, is seldom re-estimated.

    Attributes:
        settings: For the next field.
    """

    def __init__(self, settings: LocationSettings, line_jitter_px: float) -> None:
        self._estimating = replace(settings, line_jitter_px=line_jitter_px)
        self.settings = self._settled = self._estimating
        self._fields = 0
        self._jitters_px: deque[float] = deque(maxlen=JITTERS)

    def alike(self, packed: PackedField) -> int:
        """Number of fields like the next one, from it on, that have its settings whatever is seen in them."""
        own = settings_for(packed, self._estimating)
        if not own.line_jitter_px or not own.solves_line_shifts(packed.bits):
            return sys.maxsize
        return 1 if self._due else JITTER_EVERY - self._fields % JITTER_EVERY

    def blobs(self, packed: PackedField) -> Blobs:
        """Blobs of the next field."""
        blobs = measure(packed, None, self.settings)
        self.note(blobs)
        return blobs

    def note(self, blobs: Blobs) -> None:
        """Take over what the next field's blobs, located with its settings, tell of the equipment."""
        self._fields += 1
        if blobs.line_jitter_px is not None:
            self._jitters_px.append(blobs.line_jitter_px)
            likely_px = float(np.median(self._jitters_px))
            self._settled = replace(self._estimating, line_jitter_px=likely_px, line_jitter_known=True)
        self.settings = self._estimating if self._due else self._settled

    @property
    def _due(self) -> bool:
        return len(self._jitters_px) < JITTERS or self._fields % JITTER_EVERY == 0


def whole_blobs(blobs: Blobs, view: View, local_field: LocalField | None = None) -> ViewBlobs:
    """Blobs of a view without those cut off by the field's edge or the seam, whose centres are false.

    The view's local field, known displacements beyond the model, is subtracted.
    """
    own = whole(blobs, view.first_column, view.end_column)
    xy_px = blobs.xy_px[own]
    # Taken off the blobs rather than added to the functional model: equations (4) to (7) stay as printed, and
    # a rig without a local field pays nothing for it.
    if local_field is not None:
        xy_px = xy_px - local_field.at(xy_px)
    return ViewBlobs(xy_px, blobs.sigma_px[own], blobs.common_px[own], blobs.common_reach_px)


def whole(blobs: Blobs, first_column: int, end_column: int) -> NDArray[np.bool_]:
    """(N,) True for blobs that lie wholly within the columns."""
    x, half = blobs.xy_px[:, 0], blobs.width_px / 2
    inside = (x - half >= first_column - 0.5) & (x + half <= end_column - 0.5)
    own: NDArray[np.bool_] = inside & ~blobs.at_border
    return own
