"""Whether the devices can measure, and what each of them lacks. Nothing else."""

from typing import Literal, NamedTuple

from grabberd.acquisition import Signal
from grabberd.errors import Cause
from grabberd.service.device.device_state import DeviceState
from grabberd.service.device.instrument import Instrument
from grabberd.service.device.status_board import DeviceStatus

STREAMING = frozenset({DeviceState.READY, DeviceState.NO_SIGNAL, DeviceState.CAPTURING})


class Lack(NamedTuple):
    """What keeps a device from measuring: its kind, a sentence, what can be done, and why in a word."""

    device: str
    lacks: Literal["device", "signal", "calibration"]
    message: str
    hint: str
    code: Cause | None


def lacks_of(instrument: Instrument) -> list[Lack]:
    """What a device lacks; empty where points can be measured."""
    status = instrument.board.now
    said = (_device(status), _signal(status), _calibration(instrument))
    return [Lack(instrument.name, *words) for words in said if words]  # type: ignore[arg-type]


_Said = tuple[str, str, str, Cause | None]


def _device(status: DeviceStatus) -> _Said | None:
    if status.state in STREAMING:
        return None
    words = f"it is {status.state}" + (f": {status.cause}" if status.cause else "")
    return "device", words, status.hint or "wait; the daemon goes on trying", status.code


def _signal(status: DeviceStatus) -> _Said | None:
    if status.state is not DeviceState.NO_SIGNAL and status.signal is not Signal.ABSENT:
        return None
    words = status.cause or "the camera gives no signal"
    return "signal", words, status.hint or "check camera and cable", status.code or Cause.NO_SIGNAL


def _calibration(instrument: Instrument) -> _Said | None:
    documents = instrument.setup.documents
    if not documents.get("calibration"):
        words, hint = "it has no calibration", "calibrate, or activate a calibration"
        return "calibration", words, hint, Cause.NO_CALIBRATION
    if not documents.get("object"):
        return "calibration", "it has no object model", "name one in the configuration", Cause.NO_OBJECT
    if instrument.misfit:
        hint = "check camera and standard, or calibrate with these pictures"
        return "calibration", instrument.misfit, hint, Cause.CALIBRATION_MISFIT
    return None
