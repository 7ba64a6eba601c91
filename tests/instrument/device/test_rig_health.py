"""The light of a device: what it shows, says and leaves in a capture."""

import logging
from pathlib import Path

import numpy as np
import pytest
from running import running, sealed

from grabberd.archive.capture.reader import CaptureReader
from grabberd.core.reconstruction.drift_check import RigFit, RigVerdict
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.instrument.device.field_watch import RigHealth, fit_document


def fit(verdict: RigVerdict, shift_px: float = 0.5) -> RigFit:
    return RigFit(verdict, shift_px, 0.03, shift_px / 0.03, np.full((2, 2), 0.2), 60, 25)


class Watch:
    """Says what it was given."""

    def __init__(self, *fits: RigFit) -> None:
        self.fits = list(fits)

    def see(self, _: object) -> RigFit:
        return self.fits.pop(0)


def light(*fits: RigFit) -> RigHealth:
    made = RigHealth("one")
    made._watch = Watch(*fits)  # type: ignore[assignment]
    for _ in fits:
        made.see(None)  # type: ignore[arg-type]
    return made


def test_a_rig_that_has_moved_is_said_once_with_what_to_do(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        made = light(*[fit(RigVerdict.MOVED)] * 3, fit(RigVerdict.UNKNOWN), fit(RigVerdict.MOVED))
    assert len(caplog.messages) == 1
    assert "have moved" in made.warnings[0]
    assert "grabberd check" in made.warnings[0]


def test_a_rig_that_has_moved_so_far_that_nothing_fits_is_said_too() -> None:
    made = light(fit(RigVerdict.UNMATCHED, np.nan))
    assert "moved far" in made.warnings[0]
    assert made.findings() == {"rig": {"verdict": "unmatched", "ratio": None, "shift_px": None}}


def test_that_it_fits_again_is_said_too(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        made = light(fit(RigVerdict.DOUBTFUL), fit(RigVerdict.FITS, 0.02))
    assert [record.levelname for record in caplog.records] == ["WARNING", "INFO"]
    assert made.warnings == ()


def test_what_is_kept_of_a_capture_is_the_worst_verdict_and_the_means() -> None:
    made = light(fit(RigVerdict.FITS, 0.1), fit(RigVerdict.DOUBTFUL, 0.2), fit(RigVerdict.UNKNOWN, np.nan))
    assert made.findings()["rig"]["verdict"] == "doubtful"
    assert made.findings()["rig"]["shift_px"] == pytest.approx(0.15)


def test_without_a_second_of_fields_nothing_is_kept() -> None:
    assert light(fit(RigVerdict.UNKNOWN, np.nan)).findings() == {}


def test_what_is_not_known_is_shown_as_nothing() -> None:
    assert fit_document(fit(RigVerdict.UNKNOWN, np.nan)).shift_px is None


def test_a_capture_and_its_device_tell_whether_the_rig_fits(tmp_path: Path) -> None:
    with running(tmp_path) as service:
        service.capture_control.start(None, CaptureRequest(fields=100))
        recording = sealed(service)
        with CaptureReader(recording.path) as reader:
            assert reader.meta.extra["rig"]["verdict"] == "fits"
        document = service.device_document(service.instrument(None))
    assert document.rig.verdict == "fits"
    assert document.rig.residual_px["left"]["y"] < 0.5
