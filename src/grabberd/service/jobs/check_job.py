"""A check of the calibration with the calibration frame: from a file, a job, and its order."""

import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grabberd.errors import NotReady
from grabberd.field import NumberedField
from grabberd.geometry import Calibration
from grabberd.processes.calibration.calibration_check import Check, CheckVerdict, check
from grabberd.service.calibrations.calibration_frames import frame_document
from grabberd.service.capture.capture_request import CaptureRequest
from grabberd.service.jobs.calibrate_file import frame_model, nominal_rig, rig_of
from grabberd.service.jobs.job_runner import Job, Progress
from grabberd.service.setup import location_settings, settings_of_capture
from grabberd.storage import CaptureReader

if TYPE_CHECKING:
    from grabberd.service.service import Service

SECONDS = 10.0
PATIENCE_S = 60.0
"""A capture that is not sealed so long after its end will not be."""
POLL_S = 0.1
_CAPTURED = 0.5
"""Share of the work that the capture is."""
NOTE = "check of the calibration"
VIEWS, AXES = ("left", "right"), ("x", "y")
ADVICE: Mapping[CheckVerdict, str] = {
    CheckVerdict.FITS: "the calibration fits: go on measuring",
    CheckVerdict.DOUBTFUL: "the calibration is doubtful: clean mirrors and glass, see that the calibration "
    "frame stands firmly, and check again; calibrate anew if it stays so",
    CheckVerdict.RECALIBRATE: "the calibration does not fit any more: calibrate anew, with the calibration "
    "frame",
}


def order_check(
    service: "Service",
    device: str,
    frame: str | Mapping[str, Any] | None = None,
    *,
    in_place: bool = False,
    seconds: float = SECONDS,
) -> Job:
    """Starts a capture of the calibration frame and queues its check with the device's calibration.

    Args:
        service: whose device it is.
        device: its name.
        frame: the calibration frame's name or its document; None: the one there is.
        in_place: it stands exactly where it stood when the calibration was made.
        seconds: length of the capture.

    Raises:
        NotFound: there is no device or calibration frame of that name.
        NotReady: the device does not stream, or has no calibration; CaptureRunning: one is running.
    """
    instrument = service.instrument(device)
    calibration = instrument.setup.documents.get("calibration")
    if not calibration:
        raise NotReady(
            f"device {device} has no calibration that could be checked", "calibrate, or activate one"
        )
    document = frame_document(frame)
    request = CaptureRequest(
        fields=round(seconds * instrument.rate_hz), bits=8, lines="field", note=NOTE, labels={"purpose": NOTE}
    )
    capture_id = service.capture_control.start(instrument.name, request)
    return service.jobs.submit(
        "check",
        capture_id,
        check_when_sealed,
        path=service.archive.directory / f"{capture_id}.grab",
        seconds=seconds,
        frame=document,
        calibration=dict(calibration),
        in_place=in_place,
    )


def check_when_sealed(
    progress: Progress,
    *,
    path: Path,
    seconds: float,
    frame: Mapping[str, Any],
    calibration: Mapping[str, Any],
    in_place: bool,
) -> dict[str, Any]:
    """Waits until a capture has its final name, then checks with it.

    Raises:
        NotReady: it was not sealed in time; else as `check_file`.
    """
    began = time.monotonic()
    while not path.exists():
        waited = time.monotonic() - began
        if waited > seconds + PATIENCE_S:
            raise NotReady(
                f"capture {path.stem} was not sealed within {waited:.0f} s",
                "look at the device's state, and check again",
            )
        progress(min(_CAPTURED, _CAPTURED * waited / seconds))
        time.sleep(POLL_S)
    return check_file(progress, path=path, frame=frame, calibration=calibration, in_place=in_place)


def check_file(
    progress: Progress,
    *,
    path: Path,
    frame: Mapping[str, Any],
    calibration: Mapping[str, Any] | None = None,
    in_place: bool = False,
) -> dict[str, Any]:
    """Checks a calibration with a sealed capture of the calibration frame.

    Args:
        progress: is told the share that is done.
        path: of the capture.
        frame: the calibration frame's document.
        calibration: that is checked; None: the one that the capture was made with.
        in_place: see `grabberd.processes.calibration.calibration_check.check`.

    Raises:
        NotReady: there is no calibration.
        InputError: frame or calibration are not what they should be; CaptureFileError: the capture is not.
        MeasurementError: the calibration frame is not to be found in it.
    """
    model = frame_model(frame)
    with CaptureReader(path) as reader:
        made_with = reader.runs[-1].made_with if reader.runs else {}
        document = calibration or made_with.get("calibration")
        if not document:
            raise NotReady(
                f"capture {reader.meta.id} was made without a calibration", "name the one to check"
            )
        found = check(
            _counted(reader.received(), reader.field_count, progress),
            nominal_rig(rig_of(reader)),
            model,
            Calibration.from_document(document),
            location_settings(settings_of_capture(reader.meta.config)),
            in_place=in_place,
        )
        about = {"capture": reader.meta.id, "calibration": document["id"], "calibration_frame": model.name}
    return {**about, "in_place": in_place, **check_document(found)}


def check_document(found: Check) -> dict[str, Any]:
    """A check as it is shown."""
    return {
        "verdict": found.verdict.value,
        "advice": ADVICE[found.verdict],
        "reasons": list(found.reasons),
        "fields": found.fields,
        "seen": found.seen,
        "of": found.of,
        "rmse": found.rmse._asdict(),
        "chi2": found.chi2,
        "parallax_px": found.parallax_px,
        "shift_px": _by_view(found.shift_px),
        "residual_px": _by_view(found.residual_px),
        "as_placed": found.as_placed._asdict(),
        "placed": {"angle_deg": found.placed.angle_deg, "shift_mm": found.placed.shift_mm.tolist()},
    }


def _by_view(values: Any) -> dict[str, dict[str, float]]:
    return {view: dict(zip(AXES, row.tolist(), strict=True)) for view, row in zip(VIEWS, values, strict=True)}


def _counted(fields: Iterator[NumberedField], count: int, progress: Progress) -> Iterator[NumberedField]:
    for done, field in enumerate(fields):
        if done % 10 == 0:
            progress(_CAPTURED + (1.0 - _CAPTURED) * done / max(count, 1))
        yield field
