"""Checks a calibration with a capture of the calibration frame: does it still hold?"""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from grabberd.documents.calibration_reports import PixelAxes
from grabberd.documents.named_types import JsonObject
from grabberd.documents.requests import CHECK_S
from grabberd.documents.results import AxesDocument, CheckResult, Placement
from grabberd.errors import NotReady
from grabberd.geometry import Calibration
from grabberd.processes.calibration.calibration_check import Check, CheckVerdict, check
from grabberd.service.calibrations.calibration_frames import (
    calibration_frame_document,
    calibration_frame_model,
)
from grabberd.service.capture.capture_request import CaptureRequest
from grabberd.service.jobs.calibration import nominal_rig, recorded_rig
from grabberd.service.jobs.progress import Progress, counted, portion
from grabberd.service.jobs.runner import JobSpec
from grabberd.service.setup import location_settings, settings_of_capture
from grabberd.storage import CaptureReader
from grabberd.storage.capture.schema import SUFFIX

if TYPE_CHECKING:  # the job process carries values, not the daemon's own objects
    from grabberd.service.archive.archive import Archive
    from grabberd.service.capture.capture_control import CaptureControl
    from grabberd.service.instrument import Instrument

SEALING_S = 60.0
"""A capture that is not sealed this long after its end never will be."""
POLL_S = 0.1
_CAPTURED = 0.5
"""Share of the work that the capture is."""
NOTE = "check of the calibration"
VIEWS = ("left", "right")
ADVICE: Mapping[CheckVerdict, str] = {
    CheckVerdict.FITS: "the calibration fits: go on measuring",
    CheckVerdict.DOUBTFUL: "the calibration is doubtful: clean the mirrors and the glass, make sure the "
    "calibration frame stands firmly, and check again; recalibrate if it stays doubtful",
    CheckVerdict.RECALIBRATE: "the calibration no longer fits: recalibrate with the calibration frame",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckJob(JobSpec):
    """Checks a calibration as soon as a capture is sealed; see `check_file` for the result.

    Attributes:
        path: The capture, under the name it gets when it is sealed.
        seconds: Length of the capture.
        calibration_frame: Document of the calibration frame.
        calibration: Document of the calibration to check.
        in_place: True if the calibration frame stands exactly where it stood at the calibration.
    """

    kind = "check"
    path: Path
    seconds: float
    calibration_frame: JsonObject
    calibration: JsonObject
    in_place: bool

    @classmethod
    def start(
        cls,
        captures: "CaptureControl",
        archive: "Archive",
        instrument: "Instrument",
        calibration_frame: str | JsonObject | None = None,
        *,
        in_place: bool = False,
        seconds: float = CHECK_S,
    ) -> "CheckJob":
        """Starts a capture of the calibration frame and declares its check with the device's calibration.

        The calibration frame is named or given as a document; None if there is only one.

        Raises:
            NotFound: No calibration frame has that name.
            NotReady: The device does not stream, or has no calibration.
            CaptureRunning: A capture is running already.
        """
        calibration = instrument.setup.documents.get("calibration")
        if not calibration:
            raise NotReady(
                f"device {instrument.name} has no calibration to check", "calibrate it, or activate one"
            )
        # Before the capture starts: a wrong name must not leave one behind.
        document = calibration_frame_document(calibration_frame)
        request = CaptureRequest(
            fields=round(seconds * instrument.rate_hz),
            bits=8,
            lines="field",
            note=NOTE,
            labels={"purpose": NOTE},
        )
        capture_id = captures.start(instrument.name, request).id
        return cls(
            subject=capture_id,
            path=archive.directory / f"{capture_id}{SUFFIX}",
            seconds=seconds,
            calibration_frame=document,
            calibration=calibration,
            in_place=in_place,
        )

    def run(self, progress: Progress) -> CheckResult:
        """Waits until the capture has its final name, then runs `check_file`.

        Raises:
            NotReady: The capture was not sealed in time.
        """
        self._wait_until_sealed(portion(progress, 0.0, _CAPTURED))
        return check_file(
            portion(progress, _CAPTURED, 1.0),
            path=self.path,
            calibration_frame=self.calibration_frame,
            calibration=self.calibration,
            in_place=self.in_place,
        )

    def _wait_until_sealed(self, progress: Progress) -> None:
        # The job process knows nothing of the daemon's captures; the file's name tells it all it needs.
        began_s = time.monotonic()
        while not self.path.exists():
            waited_s = time.monotonic() - began_s
            if waited_s > self.seconds + SEALING_S:
                raise NotReady(
                    f"capture {self.subject} was not sealed within {waited_s:.0f} s",
                    "look at the device's state, and check again",
                )
            progress(min(waited_s / self.seconds, 1.0))
            time.sleep(POLL_S)


def check_file(
    progress: Progress,
    *,
    path: Path,
    calibration_frame: JsonObject,
    calibration: JsonObject | None = None,
    in_place: bool = False,
) -> CheckResult:
    """Checks a calibration with a sealed capture of the calibration frame.

    Args:
        progress: Called with the share that is done.
        path: The capture.
        calibration_frame: Document of the calibration frame.
        calibration: Document of the calibration; None for the one the capture was made with.
        in_place: See `grabberd.processes.calibration.calibration_check.check`.

    Raises:
        NotReady: There is no calibration.
        InputError: Calibration frame, calibration or rig are invalid.
        CaptureFileError: The file cannot be read.
        MeasurementError: The capture does not show the calibration frame.
    """
    model = calibration_frame_model(calibration_frame)
    with CaptureReader(path) as reader:
        reader.check_unchanged(runs=())
        made_with = reader.runs[-1].made_with if reader.runs else {}
        document = calibration or made_with.get("calibration")
        if not document:
            raise NotReady(
                f"capture {reader.meta.id} was made without a calibration", "name the one to check"
            )
        found = check(
            counted(reader.received(), reader.field_count, progress),
            nominal_rig(recorded_rig(reader)),
            model,
            Calibration.from_document(document),
            location_settings(settings_of_capture(reader.meta.config)),
            in_place=in_place,
        )
        capture_id = reader.meta.id
    return _result(found, capture_id, document["id"], model.name, in_place=in_place)


def _result(
    found: Check, capture_id: str, calibration_id: str, calibration_frame: str, *, in_place: bool
) -> CheckResult:
    return CheckResult(
        capture=capture_id,
        calibration=calibration_id,
        calibration_frame=calibration_frame,
        in_place=in_place,
        verdict=found.verdict.value,
        advice=ADVICE[found.verdict],
        reasons=list(found.reasons),
        fields=found.fields,
        seen=found.seen,
        of=found.of,
        rmse=AxesDocument(**found.rmse._asdict()),
        chi2=found.chi2,
        parallax_px=found.parallax_px,
        shift_px=_by_view(found.shift_px),
        residual_px=_by_view(found.residual_px),
        as_placed=AxesDocument(**found.as_placed._asdict()),
        placed=Placement(angle_deg=found.placed.angle_deg, shift_mm=found.placed.shift_mm.tolist()),
    )


def _by_view(xy_px: NDArray[np.float64]) -> dict[str, PixelAxes]:
    """Names the rows of a (2, 2) array, in frame pixels."""
    return {view: PixelAxes(x=x, y=y) for view, (x, y) in zip(VIEWS, xy_px.tolist(), strict=True)}
