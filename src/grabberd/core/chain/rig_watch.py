"""Watch for a camera or mirrors that have moved, on the fields that are being measured."""

from collections import deque
from dataclasses import replace

import numpy as np

from grabberd.core.chain.locating import whole_views
from grabberd.core.chain.mark_watch import RigCorrection
from grabberd.core.chain.measure import MeasuredField, MeasureSetup
from grabberd.core.geometry import Rig
from grabberd.core.reconstruction import Correspondence, ImageNoise, Points
from grabberd.core.reconstruction.drift_check import LEAST_TARGETS, WINDOW, DriftCheck, RigFit, RigVerdict

EVERY_NS = 200_000_000
"""Time from one comparison to the next."""
LEAST_SHARE = 0.5
"""Points per blob of the view that shows fewer; below this, targets are identified with a wider tolerance."""
COMPARISONS_A_FIT = 5
"""One fit a second."""
_SLACK_NS = 4_000_000
"""Jitter of the fields' times: one that is early by less is the field that was due."""
MANY = 3 * LEAST_TARGETS
"""Blobs in each view that cannot all be false: some of them have to be identified as targets."""
GENEROUS_PX = 1.0
"""Displacement of image coordinates up to which the targets of a rig that has moved are still identified."""


class RigWatch:
    """Compares the pictures with the calibration while they are measured, at a fraction of measuring's cost.

    If the rig has moved by more than half a pixel, rays no longer meet and no target is identified. For this
    comparison alone, targets are then identified as if the calibration were uncertain by `GENEROUS_PX`.
    """

    def __init__(self, setup: MeasureSetup) -> None:
        rig, model = Rig.of(setup.calibration), setup.object_model
        known = setup.tracking.correspondence
        noise = ImageNoise.of(rig, model, setup.line_jitter_px, 1)
        self._calibration = setup.calibration
        self._generous = Correspondence(rig, model, noise, replace(known, unmodelled_px=GENEROUS_PX))
        self._movement = DriftCheck(rig, model)
        self._blobs: deque[int] = deque(maxlen=WINDOW)
        self._compared = 0
        self._correction: RigCorrection | None = None
        self._since_ns: int | None = None

    def see(self, measured: MeasuredField) -> RigFit | None:
        """Takes a measured field; returns the fit over the last seconds once a second, else None.

        A correction that changes is reported at once.
        """
        before, self._correction = self._correction, measured.correction
        if not self._is_due(measured.time_ns):
            changed = before is not None and before is not self._correction
            return self.fit() if changed and self._compared >= COMPARISONS_A_FIT else None
        self._movement.add(self._points(measured))
        self._compared += 1
        return self.fit() if self._compared % COMPARISONS_A_FIT == 0 else None

    def _is_due(self, time_ns: int) -> bool:
        """True if a field is to be compared, a fifth of a second after the one before."""
        if self._since_ns is None:
            self._since_ns = time_ns
        # A capture that is measured late goes back in time.
        since_ns = time_ns - self._since_ns
        if 0 <= since_ns < EVERY_NS - _SLACK_NS:
            return False
        self._since_ns = time_ns
        return True

    def fit(self) -> RigFit:
        """Fit over the last seconds."""
        fit = self._movement.fit()
        seen = sorted(self._blobs)[len(self._blobs) // 2] if self._blobs else 0
        # The median of the window: a few fields with nothing in view, or with too much, do not decide.
        if fit.verdict is RigVerdict.UNKNOWN and seen >= MANY:
            fit = replace(fit, verdict=RigVerdict.UNMATCHED)
        return fit.with_marks(None if self._correction is None else self._correction.views)

    def _points(self, measured: MeasuredField) -> Points:
        x_px, seam = measured.blobs.xy_px[:, 0], self._calibration.views[1].first_column
        fewer = int(min(np.count_nonzero(x_px < seam), np.count_nonzero(x_px >= seam)))
        self._blobs.append(fewer)
        if len(measured.points) >= LEAST_SHARE * fewer:
            return measured.points
        return self._generous.identify(*whole_views(measured.blobs, self._calibration)).points
