"""Calibrations: made from captures of the calibration frame, loaded, saved and judged."""

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from pydantic import ValidationError

from grabberd.config import RigConfig, load_config, only_device
from grabberd.core import geometry
from grabberd.core.calibration.validity import Calibrated, Volume, validity_document
from grabberd.documents.calibration_reports import CalibrationReport, CalibrationValidity
from grabberd.documents.requests import CalibrationOptions
from grabberd.errors import InputError, said
from grabberd.files.checked_file import write_text
from grabberd.files.reading import PathLike, document_of, read_documents
from grabberd.library.jobs.calibration import calibrate_files
from grabberd.memory import one_thread

Progress = Callable[[float], None]
"""Told the share that is done, from 0 to 1."""


@dataclass(frozen=True)
class Calibration:
    """A calibration of both virtual cameras.

    Attributes:
        document: The calibration as its file has it.
        report: What it rests on, with the acceptance; None for one that was loaded.
    """

    document: Mapping[str, Any]
    report: CalibrationReport | None = None

    @classmethod
    def load(cls, path: PathLike) -> Self:
        """Loads a calibration file.

        Raises:
            InputError: It cannot be read, or is not a calibration.
        """
        document = read_documents(Path(path), None)["calibration"]
        geometry.Calibration.from_document(document)
        return cls(document)

    @property
    def id(self) -> str:
        """Id of the calibration."""
        return str(self.document["id"])

    @property
    def model(self) -> geometry.Calibration:
        """Both cameras as the functional model takes them."""
        return geometry.Calibration.from_document(self.document)

    @property
    def verdict(self) -> str | None:
        """Verdict of the acceptance: "passed", "passed_with_remarks" or "failed"; None without one."""
        acceptance = (self.document.get("details") or {}).get("acceptance") or {}
        return acceptance.get("verdict")

    @property
    def sigma0(self) -> float | None:
        """σ0 of the adjustment, 1 where residuals are as large as their σ; None if it is not known."""
        return (self.document.get("details") or {}).get("sigma0")

    def validity(
        self, volume_mm: Mapping[str, Sequence[float]] | None = None, pointing_px: float | None = None
    ) -> CalibrationValidity:
        """Computes where it is good: σ over each view and depth, and the cost of .1 px or .01° of movement.

        Args:
            volume_mm: From and to in "x", "y" and "z"; by default those of the calibration frame's targets.
                Outside of the volume σ is extrapolated, and marked so.
            pointing_px: Pointing σ of one field in x and y; by default that of the calibration frame's own.

        Raises:
            InputError: The calibration does not state its volume or pointing σ, and none is given; or the
                given one is no volume.
        """
        model, stated = self.model, (self.document.get("details") or {}).get("volume") or {}
        volume = volume_mm or stated.get("volume_mm")
        pointing = stated.get("pointing_px") if pointing_px is None else (pointing_px, pointing_px)
        fields = geometry.LocalFields(*model.local_fields, model.local_correlation)
        calibrated = Calibrated(model.views, model.covariance, fields, model.lines)
        known = _volume(self.id, volume, pointing)
        return CalibrationValidity.model_validate(validity_document(calibrated, known))

    def save(self, path: PathLike) -> Path:
        """Saves the calibration as a new file.

        Raises:
            StorageError: It exists, or cannot be written.
        """
        return write_text(Path(path), json.dumps(self.document, indent=2) + "\n")

    def save_report(self, path: PathLike) -> Path:
        """Saves the report as a new file, NAME.html to read or NAME.json for programs.

        Raises:
            InputError: It was loaded and has no report, or the name has another ending.
            ExtraMissing: matplotlib, which draws the figures of the page, is not installed.
            StorageError: The file exists, or cannot be written.
        """
        from grabberd.reports import calibration_html, document_json  # noqa: PLC0415 - it draws

        out = Path(path)
        if self.report is None:
            raise InputError(f"calibration {self.id} was loaded and has no report", "calibrate again")
        if out.suffix not in {".html", ".json"}:
            raise InputError(f"{out} is neither .html nor .json", "call the report NAME.html or NAME.json")
        document = self.report.model_dump(mode="json", by_alias=True)
        text = calibration_html(document) if out.suffix == ".html" else document_json(document)
        return write_text(out, text + "\n")

    def __repr__(self) -> str:
        return f"<Calibration {self.id}, acceptance: {self.verdict or 'not judged'}>"


@one_thread
def calibrate(
    captures: PathLike | Sequence[PathLike],
    calibration_frame: PathLike | Mapping[str, Any],
    *,
    config: PathLike | None = None,
    device: str | None = None,
    previous: Calibration | None = None,
    note: str = "",
    progress: Progress = lambda _: None,
    **options: Any,
) -> Calibration:
    """Calibrates both virtual cameras from captures of the calibration frame.

    Args:
        captures: A capture of the calibration frame, or one for each of its poses before the same rig.
        calibration_frame: File or document of the calibration frame.
        config: A configuration with the rig's nominal geometry; by default that of the capture.
        device: The device in it, where it has several.
        previous: An earlier calibration of the rig to compare with.
        note: Free text, kept with the calibration.
        progress: Told the share that is done.
        **options: Options of the adjustment, as `POST /api/v1/calibrations` takes them: `weights`, `frame`,
            `shared`, `tied`, `free`, `alpha`, `local_field`, `handedness`, `check_length`.

    Raises:
        InputError: The calibration frame, an option or the rig is invalid.
        CaptureFileError: A capture cannot be read.
        MeasurementError: The captures determine no calibration; the message says why.
    """
    single = isinstance(captures, str | os.PathLike)
    paths = [Path(captures)] if single else [Path(one) for one in captures]  # type: ignore[arg-type,union-attr]
    made = calibrate_files(
        progress,
        paths=paths,
        calibration_frame=document_of(calibration_frame),
        options=_options(options),
        note=note,
        previous=None if previous is None else dict(previous.document),
        rig=None if config is None else nominal_rig_of(Path(config), device),
    )
    return Calibration(made.calibration.to_document(), made.report)


def _volume(name: str, volume_mm: Any, pointing_px: Any) -> Volume:
    """A volume as given or as a calibration's document states it."""
    if not volume_mm or not pointing_px:
        raise InputError(
            f"calibration {name} does not state the volume of its calibration frame, or its pointing σ",
            "give volume_mm={'x': (from, to), 'y': (from, to), 'z': (from, to)} and pointing_px",
        )
    try:
        low, high = np.array([volume_mm[axis] for axis in "xyz"], np.float64).T
        sigma = float(pointing_px[0]), float(pointing_px[1])
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise InputError(
            f"{volume_mm!r:.80} is no volume", "give from and to for x, y and z, in mm"
        ) from error
    if not (
        (low < high).all() and np.isfinite([*low, *high]).all() and 0 < min(sigma) <= max(sigma) < np.inf
    ):
        raise InputError(
            f"the volume {volume_mm!r:.80} or the pointing σ {sigma} px is empty or not finite",
            "give from and to in ascending order, in mm, and a σ above 0",
        )
    return Volume(low, high, sigma)


def nominal_rig_of(config: Path, device: str | None) -> RigConfig:
    """The nominal rig of a device in a configuration; None for the only one."""
    known = load_config(config)
    return known.devices[only_device(known, device, config)].rig


def _options(given: Mapping[str, Any]) -> CalibrationOptions:
    try:
        return CalibrationOptions.model_validate(given)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        known = ", ".join(CalibrationOptions.model_fields)
        raise InputError(f"option {where}: {said(first['msg'])}", f"the options are {known}") from error
