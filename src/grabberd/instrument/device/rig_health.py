"""Rig health: camera and mirrors compared with their calibration, while fields are measured."""

import logging
import math
from collections import deque
from typing import Any

from grabberd.core.chain.measure import MeasuredField, MeasureSetup
from grabberd.core.chain.rig_watch import RigWatch
from grabberd.core.reconstruction.accuracy.drift_check import RigFit, RigVerdict
from grabberd.documents.devices import RigDocument

log = logging.getLogger(__name__)

VIEWS, AXES = ("left", "right"), ("x", "y")
MOST_FITS = 3600
"""One fit per second: a capture's findings are those of its last hour."""
WHAT_TO_DO = "check with the calibration frame (grabberd check), and recalibrate if it says so"
_MEANINGS = {
    RigVerdict.DOUBTFUL: "camera or mirrors may have moved since the calibration",
    RigVerdict.MOVED: "camera or mirrors have moved since the calibration",
    RigVerdict.UNMATCHED: "both views show targets, but by this calibration they are not the object's: "
    "camera or mirrors have moved far, or another object is there",
}


class RigHealth:
    """Health of the rig by the worker's fields; written by the worker alone, read by everybody.

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
        """Announces fields measured with this setup; another setup begins afresh.

        Args:
            setup: Setup that the following fields are measured with.
            capture: True if they are a capture's, which has fits of its own.
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
        """Problem of the rig in a sentence; None if there is none."""
        return None if self.fit is None or self.fit.verdict not in _MEANINGS else _sentence(self.fit)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings for the operator, in sentences."""
        return (f"{self.problem}; {WHAT_TO_DO}",) if self.problem else ()

    @property
    def document(self) -> RigDocument | None:
        """The fit of the last seconds as a document; None before the first."""
        return None if self.fit is None else fit_document(self.fit)

    def findings(self) -> dict[str, Any]:
        """Entries for a capture's metadata: the worst verdict and the means of its fits, if it had any."""
        known = [fit for fit in self._capture_fits if fit.verdict is not RigVerdict.UNKNOWN]
        if not known:
            return {}
        worst = max((fit.verdict for fit in known), key=list(RigVerdict).index)
        means = {key: _mean([getattr(fit, key) for fit in known]) for key in ("ratio", "shift_px")}
        return {"rig": {"verdict": worst, **means}}

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


def _sentence(fit: RigFit) -> str:
    if not math.isfinite(fit.shift_px):
        return _MEANINGS[fit.verdict]
    return (
        f"{_MEANINGS[fit.verdict]}: the views lie {fit.shift_px:.2f} px apart, where "
        f"{fit.sigma_px:.2f} px are expected"
    )


def _mean(values: list[float]) -> float | None:
    finite = [value for value in values if math.isfinite(value)]
    return sum(finite) / len(finite) if finite else None


def _known(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
