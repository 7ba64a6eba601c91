"""Whether the devices can measure, and what each of them lacks. Nothing else."""

from typing import Literal, NamedTuple

from grabberd.acquisition import Signal
from grabberd.service.instrument import Instrument
from grabberd.service.states import DeviceState
from grabberd.service.status import DeviceStatus

STREAMING = frozenset({DeviceState.READY, DeviceState.NO_SIGNAL, DeviceState.CAPTURING})


class Lack(NamedTuple):
    """What keeps a device from measuring: of what kind, in a sentence, and what can be done about it."""

    device: str
    lacks: Literal["device", "signal", "calibration"]
    message: str
    hint: str


def lacks_of(instrument: Instrument) -> list[Lack]:
    """What a device lacks; empty where points can be measured."""
    status = instrument.board.now
    said = (_device(status), _signal(status), _calibration(instrument))
    return [Lack(instrument.name, *words) for words in said if words]  # type: ignore[arg-type]


def _device(status: DeviceStatus) -> tuple[str, str, str] | None:
    if status.state in STREAMING:
        return None
    words = f"it is {status.state}" + (f": {status.cause}" if status.cause else "")
    return "device", words, status.hint or "wait; the daemon goes on trying"


def _signal(status: DeviceStatus) -> tuple[str, str, str] | None:
    if status.state is not DeviceState.NO_SIGNAL and status.signal is not Signal.ABSENT:
        return None
    return "signal", status.cause or "the camera gives no signal", status.hint or "check camera and cable"


def _calibration(instrument: Instrument) -> tuple[str, str, str] | None:
    documents = instrument.setup.documents
    if not documents.get("calibration"):
        return "calibration", "it has no calibration", "calibrate, or activate a calibration"
    if not documents.get("object"):
        return "calibration", "it has no object model", "name one in the configuration"
    if instrument.misfit:
        return "calibration", instrument.misfit, "check camera and standard, or calibrate with these pictures"
    return None
