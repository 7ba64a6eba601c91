"""The acceptance of a calibration as a document."""

from typing import Any

from grabberd.core.calibration import MeasuredLength, RigQuantity
from grabberd.core.chain.calibration.acceptance.verdict import Acceptance
from grabberd.core.chain.calibration.report_figures import number

_MOST_SYMMETRIES = 5


def acceptance_document(acceptance: Acceptance) -> dict[str, Any]:
    """The document; its keys are those of `documents.calibration_acceptance`."""
    return {
        "verdict": str(acceptance.verdict),
        "reasons": [
            {
                "code": one.code,
                "level": one.level,
                "message": one.message,
                "hint": one.hint,
                "values": dict(one.values),
            }
            for one in acceptance.reasons
        ],
        "rig": [_quantity(one) for one in acceptance.rig],
        "check_length": _length(acceptance.check_length),
        "symmetries": [str(one) for one in acceptance.symmetries[:_MOST_SYMMETRIES]],
        "patterns": [
            {"view": one.view, "correlation": one.correlation, "statistic": one.statistic}
            for one in acceptance.patterns
        ],
        "movement": {
            view: {"rms_px": one.rms_px, "drift_px": one.drift_px}
            for view, one in zip(("left", "right"), acceptance.stillness, strict=True)
        },
    }


def _quantity(one: RigQuantity) -> dict[str, Any]:
    return {
        "quantity": one.name,
        "view": one.view,
        "unit": one.unit,
        "nominal": one.nominal,
        "previous": one.previous,
        "found": one.found,
        "sigma": one.sigma,
        "nominal_z": one.nominal_z,
        "previous_z": one.previous_z,
    }


def _length(one: MeasuredLength | None) -> dict[str, Any] | None:
    if one is None:
        return None
    return {
        "first": one.check.first,
        "second": one.check.second,
        "certified_mm": one.check.length_mm,
        "measured_mm": one.measured_mm,
        "difference_mm": number(one.difference_mm),
        "sigma_mm": one.sigma_mm,
    }
