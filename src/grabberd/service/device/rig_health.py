"""The light that tells whether camera and mirrors still are as they were calibrated."""

import logging
import math
from collections import deque
from typing import Any

from grabberd.documents.devices import RigDocument
from grabberd.processes.measure import MeasuredField, MeasureSetup
from grabberd.processes.rig_watch import RigWatch
from grabberd.reconstruction.accuracy.drift_check import RigFit, RigVerdict

log = logging.getLogger(__name__)

VIEWS, AXES = ("left", "right"), ("x", "y")
MOST_FITS = 3600
"""A capture's findings are those of its last hour."""
WHAT_TO_DO = "check with the calibration frame (grabberd check), and calibrate anew if it says so"
_SEEM = {
    RigVerdict.DOUBTFUL: "camera or mirrors may have moved since the calibration",
    RigVerdict.MOVED: "camera or mirrors have moved since the calibration",
    RigVerdict.UNMATCHED: "both views show targets, but by this calibration they are not the object's: "
    "camera or mirrors have moved far, or another object is there",
}


class RigHealth:
    """What the worker's fields say of the rig; written by the worker alone, read by everybody.

    Attributes:
        fit: of the last seconds, or None before there was one.
    """

    def __init__(self, device: str) -> None:
        self.fit: RigFit | None = None
        self._device = device
        self._setup: MeasureSetup | None = None
        self._watch: RigWatch | None = None
        self._told = RigVerdict.FITS
        self._of_capture: deque[RigFit] = deque(maxlen=MOST_FITS)

    def begin(self, setup: MeasureSetup, *, capture: bool = False) -> None:
        """Fields measured with this follow; another calibration begins afresh, a capture counts its own."""
        if setup is not self._setup:
            self._setup, self._watch, self.fit = setup, RigWatch(setup), None
        if capture:
            self._of_capture.clear()

    def see(self, measured: MeasuredField) -> None:
        """Takes a field that was measured."""
        fit = self._watch.see(measured) if self._watch else None
        if fit is None:
            return
        self.fit = fit
        self._of_capture.append(fit)
        self._tell(fit)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a person has to know, in sentences."""
        return () if self.fit is None or self.fit.verdict not in _SEEM else (_words(self.fit),)

    @property
    def document(self) -> RigDocument | None:
        """The fit of the last seconds as a document; None before the first."""
        return None if self.fit is None else fit_document(self.fit)

    def findings(self) -> dict[str, Any]:
        """What is kept of a capture: the means over its seconds, where it had any."""
        known = [fit for fit in self._of_capture if fit.verdict is not RigVerdict.UNKNOWN]
        if not known:
            return {}
        worst = max((fit.verdict for fit in known), key=list(RigVerdict).index)
        means = {key: _mean([getattr(fit, key) for fit in known]) for key in ("ratio", "shift_px")}
        return {"rig": {"verdict": worst, **means}}

    def _tell(self, fit: RigFit) -> None:
        """Once for each change; not to know is none."""
        if fit.verdict in (self._told, RigVerdict.UNKNOWN):
            return
        self._told = fit.verdict
        if fit.verdict is RigVerdict.FITS:
            log.info("device %s: pictures and calibration agree again", self._device)
        else:
            log.warning("device %s: %s", self._device, _words(fit))


def fit_document(fit: RigFit) -> RigDocument:
    """A fit as a document; unknown values are None."""
    residual = {
        view: {axis: _known(fit.residual_px[v, a]) for a, axis in enumerate(AXES)}
        for v, view in enumerate(VIEWS)
    }
    return RigDocument(
        verdict=fit.verdict,
        shift_px=_known(fit.shift_px),
        sigma_px=_known(fit.sigma_px),
        ratio=_known(fit.ratio),
        residual_px=residual,
        targets=fit.targets,
        fields=fit.fields,
    )


def _words(fit: RigFit) -> str:
    if not math.isfinite(fit.shift_px):
        return f"{_SEEM[fit.verdict]}; {WHAT_TO_DO}"
    return (
        f"{_SEEM[fit.verdict]}: the views lie {fit.shift_px:.2f} px apart, where {fit.sigma_px:.2f} px are "
        f"expected; {WHAT_TO_DO}"
    )


def _mean(values: list[float]) -> float | None:
    finite = [value for value in values if math.isfinite(value)]
    return sum(finite) / len(finite) if finite else None


def _known(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
