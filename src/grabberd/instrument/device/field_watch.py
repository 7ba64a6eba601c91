"""Checks on the measured fields: the rig, the order of fields, and the history of the last minutes.

Camera and mirrors are compared with their calibration, and the order of fields with that of their times; a
few numbers of each field of the last minutes are kept for later display.
"""

import logging
import math
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd import runtime
from grabberd.core.chain.locating import whole, whole_views
from grabberd.core.chain.mark_watch import RigCorrection
from grabberd.core.chain.measure import MeasuredField, MeasureSetup
from grabberd.core.field import PAL_HZ
from grabberd.core.geometry import Rig
from grabberd.core.geometry.document_reader import finite
from grabberd.core.reconstruction import Correspondence, ImageNoise, Points
from grabberd.core.reconstruction.drift_check import (
    LEAST_TARGETS,
    WINDOW,
    DriftCheck,
    MarkState,
    RigFit,
    RigVerdict,
)
from grabberd.core.reconstruction.field_order import KNOWN, FieldOrderCheck, FieldOrderFit, Order
from grabberd.core.reconstruction.section_width import facing_targets, section_widths
from grabberd.documents.devices import FieldOrderDocument, MarksDocument, RigDocument

log = logging.getLogger(__name__)

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


VIEWS, AXES = ("left", "right"), ("x", "y")
MOST_FITS = 3600
"""One fit per second: a capture's findings are those of its last hour."""
WHAT_TO_DO = "check with the calibration frame (grabberd check), and recalibrate if it says so"
_MEANINGS = {
    RigVerdict.CORRECTED: "camera or mirrors have moved since the calibration; the marks correct it",
    RigVerdict.DOUBTFUL: "camera or mirrors may have moved since the calibration",
    RigVerdict.MOVED: "camera or mirrors have moved since the calibration",
    RigVerdict.UNMATCHED: "both views show targets, but by this calibration they are not the object's: "
    "camera or mirrors have moved far, or another object is there",
}


class RigHealth:
    """Health of the rig, from the worker's fields; written by the worker alone, read by any thread.

    Attributes:
        fit: Fit of the last seconds, or None before there was one.
    """

    def __init__(self, device: str) -> None:
        self.fit: RigFit | None = None
        self._device = device
        self._setup: MeasureSetup | None = None
        self._watch: RigWatch | None = None
        self._logged = RigVerdict.FITS
        self._capture_fits: deque[RigFit] = deque(maxlen=MOST_FITS)

    def begin(self, setup: MeasureSetup, *, capture: bool = False) -> None:
        """Announces fields measured with this setup; a different setup starts again.

        Args:
            setup: Setup that the following fields are measured with.
            capture: True if they belong to a capture, which has separate fits.
        """
        if setup is not self._setup:
            self._setup, self._watch, self.fit = setup, RigWatch(setup), None
        if capture:
            self._capture_fits.clear()

    def see(self, measured: MeasuredField) -> None:
        """Takes a measured field."""
        fit = self._watch.see(measured) if self._watch else None
        if fit is None:
            return
        self.fit = fit
        self._capture_fits.append(fit)
        self._log_change(fit)

    @property
    def problem(self) -> str | None:
        """Sentence about the rig; None if it has not moved, or that is unknown."""
        return None if self.fit is None or self.fit.verdict not in _MEANINGS else _sentence(self.fit)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings for the operator, in sentences."""
        harmless = self.fit is not None and self.fit.verdict is RigVerdict.CORRECTED
        return (f"{self.problem}; {WHAT_TO_DO}",) if self.problem and not harmless else ()

    @property
    def document(self) -> RigDocument | None:
        """The fit of the last seconds as a document; None before the first."""
        return None if self.fit is None else fit_document(self.fit)

    def findings(self) -> dict[str, Any]:
        """Entries for a capture's metadata: the worst verdict and the means of its fits, if there are any."""
        known = [fit for fit in self._capture_fits if fit.verdict is not RigVerdict.UNKNOWN]
        if not known:
            return {}
        worst = max((fit.verdict for fit in known), key=list(RigVerdict).index)
        means = {key: _mean([getattr(fit, key) for fit in known]) for key in ("ratio", "shift_px")}
        marks = _largest_corrections(known)
        return {"rig": {"verdict": worst, **means, **({"corrected_px": marks} if marks else {})}}

    def _log_change(self, fit: RigFit) -> None:
        """Logs each change of the verdict once; an unknown verdict is no change."""
        if fit.verdict in (self._logged, RigVerdict.UNKNOWN):
            return
        self._logged = fit.verdict
        if fit.verdict is RigVerdict.FITS:
            log.info("device %s: pictures and calibration agree again", self._device)
        else:
            log.warning("device %s: %s; %s", self._device, _sentence(fit), WHAT_TO_DO)


def fit_document(fit: RigFit) -> RigDocument:
    """A fit as a document; unknown values are None."""
    residual = {
        view: {axis: finite(fit.residual_px[v, a]) for a, axis in enumerate(AXES)}
        for v, view in enumerate(VIEWS)
    }
    return RigDocument(
        verdict=fit.verdict,
        shift_px=finite(fit.shift_px),
        sigma_px=finite(fit.sigma_px),
        ratio=finite(fit.ratio),
        residual_px=residual,
        targets=fit.targets,
        fields=fit.fields,
        marks=None
        if fit.marks is None
        else {view: MarksDocument(**one._asdict()) for view, one in zip(VIEWS, fit.marks, strict=True)},
    )


def _largest_corrections(fits: Sequence[RigFit]) -> dict[str, float]:
    """Largest movements that were taken off, by view; empty without marks."""
    marks = [fit.marks for fit in fits if fit.marks is not None]
    return {view: max(one[v].size_px for one in marks) for v, view in enumerate(VIEWS)} if marks else {}


_OF_MARKS = {
    MarkState.MOVING: "the marks of the {} view are moving",
    MarkState.CONTRADICTORY: "the marks of the {} view do not move as one, look for a loose or dirty one",
    MarkState.HIDDEN: "fewer than two marks of the {} view are seen",
}


def _said_of_marks(fit: RigFit) -> list[str]:
    said = []
    for view, one in zip(VIEWS, fit.marks or (), strict=False):
        if one.size_px:
            said.append(f"{view} by {one.size_px:.2f} px (σ {one.sigma_px:.2f} px)")
        if one.state in _OF_MARKS:
            said.append(_OF_MARKS[one.state].format(view))
    return said


def _sentence(fit: RigFit) -> str:
    said = _said_of_marks(fit) if fit.verdict in (RigVerdict.CORRECTED, RigVerdict.DOUBTFUL) else []
    if said:
        return f"{_MEANINGS[fit.verdict]}: {', '.join(said)}"
    if not math.isfinite(fit.shift_px):
        return _MEANINGS[fit.verdict]
    return (
        f"{_MEANINGS[fit.verdict]}: the views lie {fit.shift_px:.2f} px apart, where "
        f"{fit.sigma_px:.2f} px are expected"
    )


def _mean(values: list[float]) -> float | None:
    finite = [value for value in values if math.isfinite(value)]
    return sum(finite) / len(finite) if finite else None


_BY_WEIGHT = (Order.NO_MOVEMENT, Order.UNCLEAR, Order.RIGHT, Order.SAME_INSTANT, Order.REVERSED)


class FieldOrderHealth:
    """Field order, from the worker's points; written by the worker alone, read by any thread.

    An object at rest does not show the order: the result of its last movement holds until the next one.

    Attributes:
        fit: The newest fit that shows the order, else the newest; None before the first.
    """

    def __init__(self, device: str) -> None:
        self.fit: FieldOrderFit | None = None
        self._device = device
        self._setup: MeasureSetup | None = None
        self._check: FieldOrderCheck | None = None
        self._capture_fit: FieldOrderFit | None = None
        self._logged = Order.RIGHT

    def begin(self, setup: MeasureSetup, *, capture: bool = False, interlaced: bool = True) -> None:
        """Announces fields with continuous numbers; results of another setup are dropped.

        Args:
            setup: Setup that the following fields are measured with.
            capture: True if they belong to a capture, which has a separate fit.
            interlaced: False if they are progressive pictures, whose order cannot be wrong.
        """
        if setup is not self._setup:
            self._setup, self.fit = setup, None
        if capture:
            self._capture_fit = None
        if not interlaced:
            self.fit = self._check = None
            return
        # Always reset: a capture numbers its fields from its first one, which may have either parity.
        self._check = FieldOrderCheck(setup.object_model.target)

    def see(self, measured: MeasuredField) -> None:
        """Takes a measured field."""
        if self._check is not None and self._check.add(measured.n, measured.points):
            self._take(self._check.fit())

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings for the operator, in sentences."""
        warning = None if self.document is None else self.document.warning
        return () if warning is None else (warning,)

    @property
    def document(self) -> FieldOrderDocument | None:
        """The fit as a document; None before the first."""
        fit = self.fit
        return None if fit is None else FieldOrderDocument.of(fit)

    def findings(self) -> dict[str, Any]:
        """Entries for a capture's metadata: the gravest of its fits, if it had any; ends the capture."""
        if self._check is not None:
            self._take(self._check.finish())
        fit = self._capture_fit
        return {} if fit is None else {"field_order": FieldOrderDocument.of(fit).model_dump(mode="json")}

    def _take(self, fit: FieldOrderFit) -> None:
        if fit.order in KNOWN or self.fit is None or self.fit.order not in KNOWN:
            self.fit = fit
        if self._capture_fit is None or _weight(fit) >= _weight(self._capture_fit):
            self._capture_fit = fit
        self._log_change(fit)

    def _log_change(self, fit: FieldOrderFit) -> None:
        """Logs each change of the verdict once; a fit that does not show the order is no change."""
        if fit.order is self._logged or fit.order not in KNOWN:
            return
        self._logged = fit.order
        if warning := FieldOrderDocument.of(fit).warning:
            log.warning("device %s: %s", self._device, warning)
        else:
            log.info("device %s: fields come in the sequence of time again", self._device)


def _weight(fit: FieldOrderFit) -> int:
    return _BY_WEIGHT.index(fit.order)


KEPT_S = 300.0
"""Five minutes: 1.5 MB for each device at 50 fields a second, 3.6 MB at 120."""
FIELDS = round(KEPT_S * PAL_HZ)
MOST_FIELDS = 75_000
"""Those of five minutes at 250 fields a second."""
MOST_PAIRS = 8
"""Pairs of facing targets whose widths are kept, the outermost first."""
ROW = np.dtype(
    [
        ("time_ns", "i8"),
        ("targets", "u2", 2),
        ("points", "u2"),
        ("residual_px", "f4"),
        ("latency_ms", "f4"),
        ("width_mm", "f4", MOST_PAIRS),
        ("sigma_mm", "f4", MOST_PAIRS),
    ]
)
"""A field: NaN for what is not known."""


class History(NamedTuple):
    """Fields in the order of their times.

    Attributes:
        views: Names of the views that targets were counted in.
        pairs: Ids of the facing targets.
        rows: (K,) of `ROW`.
    """

    views: tuple[str, ...]
    pairs: list[tuple[int, int]]
    rows: NDArray[np.void]


class FieldHistory:
    """A ring of measured fields, written by the worker, read by any thread."""

    def __init__(self, fields: int = FIELDS) -> None:
        self._rows = np.zeros(fields, ROW)
        self._count = 0
        self._newest_ns = -math.inf
        self._views: tuple[str, ...] = ()
        self._pairs: list[tuple[int, int]] = []
        self._lock = runtime.lock()

    def keep(self, rate_hz: float) -> None:
        """Keeps five minutes at this rate from now on; fields at another rate are dropped."""
        fields = min(max(round(KEPT_S * rate_hz), 1), MOST_FIELDS)
        if fields != len(self._rows):
            with self._lock:
                self._rows, self._count = np.zeros(fields, ROW), 0

    def see(self, measured: MeasuredField, setup: MeasureSetup, latency_ns: int) -> None:
        """Enters a field, unless there is a newer one: a capture is measured again from its start."""
        if measured.time_ns <= self._newest_ns:
            return
        row = _row(measured, setup, latency_ns)
        pairs = facing_targets(setup.object_model)[:MOST_PAIRS]
        with self._lock:
            if pairs != self._pairs:
                # Widths of another object's targets would be mistaken for theirs.
                self._count, self._pairs = 0, pairs
            self._views = tuple(view.name for view in setup.calibration.views)
            self._rows[self._count % len(self._rows)] = row
            self._count += 1
            self._newest_ns = measured.time_ns

    def since(self, time_ns: int) -> History:
        """The fields since a time."""
        with self._lock:
            count = min(self._count, len(self._rows))
            first = (self._count - count) % len(self._rows)
            times = np.roll(self._rows["time_ns"], -first)[:count]
            begin = int(np.searchsorted(times, time_ns))
            places = (first + np.arange(begin, count)) % len(self._rows)
            return History(self._views, self._pairs, self._rows[places])


def _row(measured: MeasuredField, setup: MeasureSetup, latency_ns: int) -> tuple[object, ...]:
    views = setup.calibration.views
    counts = [int(whole(measured.blobs, one.first_column, one.end_column).sum()) for one in views]
    residual_px, points = measured.points.residual_px, len(measured.points)
    rms_px = math.sqrt(residual_px @ residual_px / points) if points else math.nan
    widths = section_widths(measured.points, setup.object_model)[:MOST_PAIRS]
    lacking = [math.nan] * (MOST_PAIRS - len(widths))
    width_mm = [math.nan if one.width_mm is None else one.width_mm for one in widths]
    sigma_mm = [math.nan if one.sigma_mm is None else one.sigma_mm for one in widths]
    return (
        measured.time_ns,
        counts,
        points,
        rms_px,
        latency_ns / 1e6,
        width_mm + lacking,
        sigma_mm + lacking,
    )
