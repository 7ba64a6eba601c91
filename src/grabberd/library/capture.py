"""A capture file: its fields, points, ledger and runs; measured, judged, exported and drawn."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from grabberd.archive.capture.meta import CaptureMeta
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.rows import RunInfo
from grabberd.archive.export.field_pictures import export_png
from grabberd.archive.export.formats import POINT_EXPORTS
from grabberd.archive.input_files import read_truth
from grabberd.archive.measure_setups import settings_of_capture
from grabberd.core.chain.accuracy import Investigation, InvestigationSettings, investigate
from grabberd.core.ledger import Ledger
from grabberd.errors import InputError, NotFound, NotReady
from grabberd.files.reading import PathLike, document_of
from grabberd.library.calibrations import Calibration, Progress
from grabberd.library.fields import CapturedField, Fields
from grabberd.library.jobs.measurement import measure_file
from grabberd.library.tables import Chosen, PointTable, Table, optional, read_points
from grabberd.memory import one_thread

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def _axes(given: "Axes | None", **options: Any) -> "Axes":
    if given is not None:
        return given
    pyplot = optional("matplotlib.pyplot", "a plot")
    _, made = pyplot.subplots(layout="constrained", **options)
    return made


def draw_field(field: CapturedField, ax: "Axes | None" = None) -> "Axes":
    """Draws a field in frame pixels."""
    axes = _axes(ax, figsize=(8, 6))
    first, last, step = field.lines[0], field.lines[-1], field.packed.y_step
    extent = (-0.5, field.packed.columns - 0.5, last + step / 2, first - step / 2)
    axes.imshow(field.picture, cmap="gray", vmin=0, vmax=255, extent=extent)
    axes.set(title=f"field {field.n}, {field.time_s:.2f} s", xlabel="x, px", ylabel="y, frame lines")
    return axes


def draw_points(points: PointTable, ax: "Axes | None" = None) -> "Axes":
    """Draws points in the object's frame as seen along z; the colour is z."""
    wide, high = np.ptp(points["x_mm"]), np.ptp(points["y_mm"])
    # As wide as a notebook's page, and as high as the object with its labels.
    axes = _axes(ax, figsize=(8, min(max(8 * high / max(wide, 1.0), 1.5), 8) + 1))
    drawn = axes.scatter(points["x_mm"], points["y_mm"], c=points["z_mm"], s=14)
    bar = axes.figure.colorbar(drawn, ax=axes)
    bar.set_label("z, mm")
    axes.set(xlabel="x, mm", ylabel="y, mm", aspect="equal", title=f"{len(points)} points")
    return axes


def draw_target(points: PointTable, target: int, axis: str, ax: "Axes | None" = None) -> "Axes":
    """Draws a coordinate of a target over time, with its σ."""
    name = f"{axis}_mm"
    value, sigma, chosen = points[name], points[f"sigma_{name}"], points["target"] == target
    if not chosen.any():
        known = ", ".join(map(str, points.targets.target))
        raise NotFound(f"target {target} was found in no field", f"the targets are {known}")
    axes = _axes(ax, figsize=(9, 3.5))
    axes.errorbar(points["time_s"][chosen], value[chosen], sigma[chosen], fmt=".-", elinewidth=1)
    axes.set(xlabel="time, s", ylabel=f"{axis}, mm", title=f"target {target}")
    return axes


def draw_courses(table: Table, time: str, columns: Sequence[str], ax: "Axes | None" = None) -> "Axes":
    """Draws columns of a table over its time, with their σ where they have one."""
    axes = _axes(ax, figsize=(9, 3.5))
    for name in columns:
        sigma = table[f"sigma_{name}"] if f"sigma_{name}" in table.units else None
        axes.errorbar(table[time], table[name], sigma, fmt=".-", elinewidth=1, label=name)
    units = sorted({table.units[name] for name in columns} - {""})
    axes.set(xlabel="time, s", ylabel=", ".join(units))
    axes.legend()
    return axes


def draw_map(values: NDArray[np.float64], title: str, unit: str, ax: "Axes | None" = None) -> "Axes":
    """Draws values over the targets' grid, the rows of the object along x."""
    axes = _axes(ax, figsize=(8, 3))
    axes.set_facecolor("lightgray")
    drawn = axes.imshow(values.T, aspect="auto")
    bar = axes.figure.colorbar(drawn, ax=axes)
    bar.set_label(unit)
    axes.set(title=title, xlabel="row", ylabel="column")
    return axes


@dataclass(frozen=True)
class Measurement:
    """A run added by `Capture.measure`.

    Attributes:
        run: Number of the run, as `Capture.points` takes it.
        fields: Number of fields measured; `points`: number of points found in them.
        verdict: "measured_well", "measured_with_gaps" or "not_measured"; `in_words`: with the reason.
        warnings: What else a reader of the points should know, as sentences.
    """

    run: int
    fields: int
    points: int
    verdict: str | None
    in_words: str = field(repr=False)
    warnings: Sequence[str] = ()


class Capture:
    """A capture file, opened by `grabberd.open`.

    Whatever is asked for is read from the file at that moment. It is closed by `close`, at the end of a
    `with` block, or with its last reference.

    Attributes:
        path: The file.
        fields: Its fields, by number.
    """

    def __init__(self, path: PathLike) -> None:
        self.path = Path(path)
        self._reader = CaptureReader(self.path)
        self.fields = Fields(self._reader)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes the file."""
        self._reader.close()

    def __repr__(self) -> str:
        state = {None: self.meta.state, True: "complete", False: "incomplete"}[self.meta.complete]
        return f"<Capture {self.id}: {len(self.fields)} fields at {self.rate_hz:g} Hz, {state}>"

    @property
    def meta(self) -> CaptureMeta:
        """Metadata of the capture as a whole, such as device, configuration, site and note."""
        return self._reader.meta

    @property
    def id(self) -> str:
        """Id of the capture."""
        return self.meta.id

    @property
    def labels(self) -> dict[str, str]:
        """Its labels as recorded, e.g. cow, teat and liner."""
        return dict(self.meta.labels)

    @property
    def rate_hz(self) -> float:
        """Nominal fields per second."""
        return self.meta.rate_hz

    @property
    def ledger(self) -> Ledger:
        """Ledger of the capture: outcomes of all expected fields."""
        return self._reader.ledger

    @property
    def runs(self) -> list[RunInfo]:
        """The runs: sets of points, each with its calibration and configuration."""
        return self._reader.runs

    @property
    def calibration(self) -> Calibration | None:
        """The calibration of the newest run; None if the capture has not been measured."""
        document = self._newest().get("calibration")
        return Calibration(document) if document else None

    def points(
        self, run: int | None = None, *, first_n: int = 0, end_n: int | None = None, every: int = 1
    ) -> PointTable:
        """The points of a run, a row for each target found in each field.

        Args:
            run: Number of the run; None for the newest.
            first_n: Number of the first field.
            end_n: Number after the last field; None for all that follow.
            every: 2 for every second field, and so on.

        Raises:
            NotFound: The run does not exist, or none of these fields has points.
            CaptureFileError: The points are damaged.
        """
        return read_points(self._reader, Chosen(run, first_n, end_n, every))

    @one_thread
    def measure(
        self,
        calibration: Calibration | PathLike,
        object_model: PathLike | Mapping[str, Any] | None = None,
        *,
        method: str | None = None,
        line_jitter_px: float | None = None,
        include_damaged: bool = False,
        progress: Progress = lambda _: None,
    ) -> Measurement:
        """Re-measures all fields; the points are added to the file as a new run.

        Args:
            calibration: The calibration to measure with.
            object_model: File or document of the object model; by default that of the newest run.
            method: Location method in place of the capture's own.
            line_jitter_px: Standard deviation of the lines' shifts, in place of the capture's own.
            include_damaged: True to measure damaged fields as well.
            progress: Told the share that is done.

        Raises:
            NotReady: There is no object model.
            InputError: A setting is invalid.
            CalibrationMismatch: The calibration is for pictures of another size.
            MeasurementError: No target was found in any field; no run was added.
        """
        given = {"method": method, "line_jitter_px": line_jitter_px, "include_damaged": include_damaged}
        chosen = {name: value for name, value in given.items() if value is not None}
        known = calibration if isinstance(calibration, Calibration) else Calibration.load(calibration)
        made_with = {
            "calibration": dict(known.document),
            "object": self._object(object_model),
            "settings": settings_of_capture(self.meta.config) | chosen,
        }
        made = measure_file(progress, path=self.path, made_with=made_with)
        covered = made.coverage
        verdict, words = (str(covered.verdict), covered.in_words) if covered else (None, "")
        return Measurement(made.run, made.fields, made.points, verdict, words, made.warnings)

    @one_thread
    def accuracy(
        self, truth: PathLike, *, run: int | None = None, fit: bool = False, limit_mm: float = 0.2
    ) -> Investigation:
        """Compares the points of a run with the truth, as the paper's Table 1.

        Args:
            truth: CSV file with the columns target, x_mm, y_mm, z_mm and, if it moves, n.
            run: Number of the run; None for the newest.
            fit: True to turn and shift the points onto the truth first.
            limit_mm: Greatest allowed length-measuring error.

        Raises:
            InputError: The truth cannot be read.
            MeasurementError: No point could be matched.
        """
        meta = self.meta
        settings = InvestigationSettings(
            fit=fit, limit_mm=limit_mm, bits=meta.bits, interlaced=meta.is_interlaced
        )
        return investigate(self._reader.timed_points(run), read_truth(Path(truth)), settings)

    def export(self, file_format: str, folder: PathLike, *, run: int | None = None) -> Path:
        """Writes the points of a run, or the pictures, into a new folder.

        Args:
            file_format: One of csv, csv-semicolon, parquet, hdf5, mat, c3d, ply, png.
            folder: The folder.
            run: Number of the run; None for the newest.

        Raises:
            InputError: The format is unknown.
            ExtraMissing: What it needs is not installed.
            StorageError: The folder exists and is not empty, or cannot be written.
        """
        out = Path(folder)
        if file_format == "png":
            export_png(self.path, out)
        elif file_format in POINT_EXPORTS:
            POINT_EXPORTS[file_format](self.path, out, run, None)
        else:
            known = ", ".join([*POINT_EXPORTS, "png"])
            raise InputError(f"a capture cannot be written as {file_format}", f"choose from {known}")
        return out

    def plot_field(self, n: int, ax: "Axes | None" = None) -> "Axes":
        """Draws a field in frame pixels.

        Raises:
            NotFound: The field is not in the file.
            ExtraMissing: matplotlib is not installed.
        """
        return draw_field(self.fields[n], ax)

    def plot_points(self, n: int, run: int | None = None, ax: "Axes | None" = None) -> "Axes":
        """Draws the points of a field as seen along z; the colour is z.

        Raises:
            NotFound: The field has no points.
            ExtraMissing: matplotlib is not installed.
        """
        axes = draw_points(self.points(run, first_n=n, end_n=n + 1), ax)
        axes.set_title(f"points of field {n}")
        return axes

    def plot_target(
        self, target: int, axis: str = "z", run: int | None = None, ax: "Axes | None" = None
    ) -> "Axes":
        """Draws a coordinate of a target over time, with its σ.

        Raises:
            NotFound: The capture has no points.
            InputError: There is no such axis.
            ExtraMissing: matplotlib is not installed.
        """
        return draw_target(self.points(run), target, axis, ax)

    def _newest(self) -> Mapping[str, Any]:
        """Calibration, object model and settings of the newest run; nothing if there is none."""
        runs = self.runs
        return runs[-1].made_with if runs else {}

    def _object(self, given: PathLike | Mapping[str, Any] | None) -> dict[str, Any]:
        if given is not None:
            return document_of(given)
        if known := self._newest().get("object"):
            return dict(known)
        raise NotReady(f"capture {self.id} has no object model", "give the file or document of one")


def open_capture(path: PathLike) -> Capture:
    """Opens a capture file.

    Args:
        path: The file, NAME.grab, or NAME.grab.part while it is being recorded.

    Raises:
        CaptureFileError: It is missing, damaged, not a capture, or of a later version.
    """
    return Capture(path)
