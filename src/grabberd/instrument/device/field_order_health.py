"""Field order health: whether fields come in the sequence of time, while they are measured."""

import logging
from typing import Any

from grabberd.core.chain.measure import MeasuredField, MeasureSetup
from grabberd.core.reconstruction.accuracy.field_order import KNOWN, FieldOrderCheck, FieldOrderFit, Order
from grabberd.documents.field_order import FieldOrderDocument

log = logging.getLogger(__name__)

_BY_WEIGHT = (Order.NO_MOVEMENT, Order.UNCLEAR, Order.RIGHT, Order.SAME_INSTANT, Order.REVERSED)


class FieldOrderHealth:
    """Field order by the worker's points; written by the worker alone, read by everybody.

    An object at rest tells nothing: what its last movement told holds until another one tells something else.

    Attributes:
        fit: The newest fit that tells the order, else the newest; None before the first.
    """

    def __init__(self, device: str) -> None:
        self.fit: FieldOrderFit | None = None
        self._device = device
        self._setup: MeasureSetup | None = None
        self._check: FieldOrderCheck | None = None
        self._capture_fit: FieldOrderFit | None = None
        self._logged = Order.RIGHT

    def begin(self, setup: MeasureSetup, *, capture: bool = False, interlaced: bool = True) -> None:
        """Announces fields whose numbers go on from one another; what another setup told holds no longer.

        Args:
            setup: Setup that the following fields are measured with.
            capture: True if they are a capture's, which has a fit of its own.
            interlaced: False if they are progressive pictures, which have no order to be wrong.
        """
        if setup is not self._setup:
            self._setup, self.fit = setup, None
        if capture:
            self._capture_fit = None
        if not interlaced:
            self.fit = self._check = None
            return
        # Always afresh: a capture numbers its fields from its own first one, which may be of either parity.
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
        """Logs each change of the verdict once; a fit that does not tell the order is no change."""
        if fit.order is self._logged or fit.order not in KNOWN:
            return
        self._logged = fit.order
        if warning := FieldOrderDocument.of(fit).warning:
            log.warning("device %s: %s", self._device, warning)
        else:
            log.info("device %s: fields come in the sequence of time again", self._device)


def _weight(fit: FieldOrderFit) -> int:
    return _BY_WEIGHT.index(fit.order)
