"""Field order by the measured points: whether fields follow one another in time as they are numbered."""

import math

from pydantic import Field

from grabberd.core.reconstruction.accuracy.field_order import FieldOrderFit, Order
from grabberd.documents.document import Document

_WRONG = {
    Order.REVERSED: (
        "the two fields of each frame change places in time",
        "run 'grabberd devices --check-field-order', set the option that it names, and record again",
    ),
    Order.SAME_INSTANT: (
        "both fields of a frame show the same instant",
        "this grabber delivers one moment a frame, not two: use another one; 'grabberd devices' rates them",
    ),
}


class FieldOrderDocument(Document):
    """Order of the fields in time, as the points of moving targets show it."""

    order: Order = Field(
        description="'same_instant': both fields of a frame were exposed at once; 'no_movement', 'unclear': "
        "the points tell nothing, or not yet."
    )
    shift_fields: float | None = Field(
        description="Time by which each second field is displaced against its number, in fields: 0 in the "
        "right order, 0.5 for fields of one instant, 1 in reversed order."
    )
    sigma_fields: float | None
    zigzag_mm: float | None = Field(
        description="Root mean square distance, over the moving targets, between the points of a field and "
        "the path through the fields around it that this causes."
    )
    fields: int = Field(description="Number of fields with movement that it was determined from.")

    @classmethod
    def of(cls, fit: FieldOrderFit) -> "FieldOrderDocument":
        """The document of a fit; unknown values are None."""
        known = {name: _known(getattr(fit, name)) for name in ("shift_fields", "sigma_fields", "zigzag_mm")}
        return cls(order=fit.order, fields=fit.fields, **known)

    @property
    def problem(self) -> tuple[str, str] | None:
        """Problem and remedy; None where nothing is known to be wrong."""
        if self.order not in _WRONG:
            return None
        wrong, remedy = _WRONG[self.order]
        size = (
            "" if self.zigzag_mm is None else f": points of moving targets zigzag by {self.zigzag_mm:.2f} mm"
        )
        return f"{wrong}{size}", remedy

    @property
    def warning(self) -> str | None:
        """Problem and remedy in a sentence; None where nothing is known to be wrong."""
        return "; ".join(self.problem) if self.problem else None


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
