"""Readiness of a device: can it measure, and what is missing? Nothing else."""

from grabberd.acquisition import Signal
from grabberd.documents.devices import LackDocument
from grabberd.documents.named_types import LackKind
from grabberd.documents.states import DeviceState
from grabberd.errors import Cause
from grabberd.service.device.status_board import STREAMING, DeviceStatus
from grabberd.service.instrument import Instrument

_Reason = tuple[LackKind, str, str, Cause | None]


def lacks_of(instrument: Instrument) -> list[LackDocument]:
    """List of all that a device lacks; empty if points can be measured."""
    status = instrument.board.now
    reasons = (_device(status), _signal(status), _calibration(instrument))
    return [
        LackDocument(device=instrument.name, lacks=lacks, message=message, hint=hint, cause_code=code)
        for lacks, message, hint, code in filter(None, reasons)
    ]


def _device(status: DeviceStatus) -> _Reason | None:
    if status.state in STREAMING:
        return None
    message = f"it is {status.state}" + (f": {status.cause}" if status.cause else "")
    return "device", message, status.hint or "wait; the daemon goes on trying", status.code


def _signal(status: DeviceStatus) -> _Reason | None:
    if status.state is not DeviceState.NO_SIGNAL and status.signal is not Signal.ABSENT:
        return None
    message = status.cause or "the camera gives no signal"
    return "signal", message, status.hint or "check camera and cable", status.code or Cause.NO_SIGNAL


def _calibration(instrument: Instrument) -> _Reason | None:
    documents = instrument.setup.documents
    if not documents.get("calibration"):
        message, hint = "it has no calibration", "calibrate, or activate a calibration"
        return "calibration", message, hint, Cause.NO_CALIBRATION
    if not documents.get("object"):
        return "calibration", "it has no object model", "name one in the configuration", Cause.NO_OBJECT
    if instrument.misfit:
        hint = "check camera and standard, or calibrate with these pictures"
        return "calibration", instrument.misfit, hint, Cause.CALIBRATION_MISFIT
    return None
