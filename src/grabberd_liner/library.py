"""Captures and analyses as `import grabberd` has them: a capture file of the instrument's library that can
also be analysed, and its analysis with quantities, tables and maps, each with σ.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from grabberd.archive.input_files import read_table_text
from grabberd.core.arrays import Array
from grabberd.errors import InputError
from grabberd.files.disk import results_folder
from grabberd.files.reading import PathLike, document_of
from grabberd.library import capture
from grabberd.library.calibrations import Progress
from grabberd.library.tables import Table
from grabberd.memory import one_thread
from grabberd_liner.analyses.export import check_formats, write_analysis
from grabberd_liner.analyses.job import (
    AnalysisOptions,
    AnalysisOutput,
    analyse_file,
    with_log,
    write_document,
    write_page,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Quantity(NamedTuple):
    """A quantity of a capture as a whole, docs/howto/quantities.md.

    Attributes:
        value: Its value; NaN where it could not be had, and `reason` says why.
        sigma: Its σ.
        unit: Its unit.
        verdict: What ISO 5707 says of it, or "".
    """

    value: float
    sigma: float
    unit: str
    verdict: str
    reason: str


class Analysis:
    """Shape, strain, tension and pressure of a capture, by field and by phase.

    Attributes:
        lacks: Inputs that were not given, with what they would give.
        problems: What did not end the analysis, as sentences.
    """

    def __init__(self, made: AnalysisOutput) -> None:
        self._made = made
        self.lacks: Sequence[str] = tuple(made.analysis.inputs.lacks)
        self.problems: Sequence[str] = made.analysis.problems

    @property
    def tables(self) -> Sequence[str]:
        """Names of the tables that have rows; docs/reference/analysis.md describes each."""
        return [name for name, table in self._made.tables.items() if len(table)]

    def table(self, name: str) -> Table:
        """A table by its name.

        Raises:
            InputError: There is none of this name.
        """
        if name not in self._made.tables:
            known = ", ".join(self._made.tables)
            raise InputError(f"there is no table {name!r}", f"the tables are {known}")
        found = self._made.tables[name]
        return Table(found.columns, found.rows)

    @property
    def quantities(self) -> dict[str, Quantity]:
        """The quantities of the capture as a whole, by name."""
        table = self.table("quantities")
        names = ("value", "sigma_value", "unit", "verdict", "reason")
        rows = zip(*(table[name] for name in names), strict=True)
        return {
            str(name): Quantity(float(value), float(sigma), *map(str, words))
            for name, (value, sigma, *words) in zip(table["name"], rows, strict=True)
        }

    def map(self, quantity: str, n: int) -> Array:
        """(rows, columns) values of a quantity at the targets of one field, NaN where there is none.

        Args:
            quantity: A column of the table `targets`, e.g. "contact_kpa" or "sigma_contact_kpa".
            n: Number of the field.

        Raises:
            InputError: There is no such column, or the field was not analysed.
        """
        targets, grid = self.table("targets"), self._made.analysis.grid
        chosen = targets["n"] == n
        if not len(targets):
            raise InputError("no field was analysed", "; ".join(self.problems) or "see analysis.lacks")
        if not chosen.any():
            first, last = (int(end) for end in (targets["n"].min(), targets["n"].max()))
            raise InputError(f"field {n} was not analysed", f"choose one from {first} to {last}")
        places = {int(target): place for place, target in enumerate(grid.target)}
        order = [places[int(target)] for target in targets["target"][chosen]]
        values = np.full((grid.row.max() + 1, grid.column.max() + 1), np.nan)
        values[grid.row[order], grid.column[order]] = targets[quantity][chosen].astype(np.float64)
        return values

    def plot_map(self, quantity: str, n: int, ax: "Axes | None" = None) -> "Axes":
        """Draws a quantity over the targets' grid, rolled out; grey is what is not known.

        Raises:
            InputError: As `map`.
            ExtraMissing: matplotlib is not installed.
        """
        from grabberd.library.capture import draw_map  # noqa: PLC0415 - needs matplotlib

        unit = self.table("targets").units.get(quantity, "")
        return draw_map(self.map(quantity, n), f"{quantity}, field {n}", unit, ax)

    def plot(self, columns: str | Sequence[str], ax: "Axes | None" = None) -> "Axes":
        """Draws columns of the table `fields` over time, with their σ where they have one.

        Raises:
            InputError: There is no such column.
            ExtraMissing: matplotlib is not installed.
        """
        from grabberd.library.capture import draw_courses  # noqa: PLC0415 - needs matplotlib

        names = [columns] if isinstance(columns, str) else columns
        return draw_courses(self.table("fields"), "time_s", names, ax)

    def save(self, folder: PathLike, formats: Sequence[str] = ("csv",)) -> list[Path]:
        """Saves tables and report in a new or empty folder; returns the files.

        Args:
            folder: The folder.
            formats: Any of csv, parquet, hdf5, vtu, ply, mat.

        Raises:
            InputError: A format is unknown.
            ExtraMissing: What a format or the report's figures need is not installed.
            StorageError: A file cannot be written, or exists.
        """
        out, made = Path(folder), self._made
        check_formats(formats)
        with results_folder(out):
            page = write_page(out, write_document(out, made))
            return [page, *write_analysis(out, made.tables, made.analysis.grid, made.about, formats)]

    def __iter__(self) -> Iterator[str]:
        return iter(self.tables)

    def __repr__(self) -> str:
        return f"<Analysis of capture {self._made.about['id']}: {', '.join(self.tables)}>"

    def __getitem__(self, name: str) -> Table:
        return self.table(name)

    @property
    def about(self) -> dict[str, Any]:
        """The capture, run, profiles and versions that it was made from."""
        return dict(self._made.about)


class Capture(capture.Capture):
    """A capture file, opened by `grabberd.open`.

    Whatever is asked for is read from the file at that moment. It is closed by `close`, at the end of a
    `with` block, or with its last reference.

    Attributes:
        path: The file.
        fields: Its fields, by number.
    """

    @one_thread
    def analyse(
        self,
        inputs: PathLike | Mapping[str, Any] | None = None,
        *,
        run: int | None = None,
        bursts: Sequence[PathLike] = (),
        vacuum_log: PathLike | None = None,
        progress: Progress = lambda _: None,
    ) -> Analysis:
        """Computes shape, strain, tension and pressure from the points of a run; nothing is written.

        Args:
            inputs: File or document of what is known besides the points, docs/howto/analyse.md; without it
                only the shape is analysed.
            run: Number of the run; None for the newest.
            bursts: Other captures of the same liner, combined with it by phase.
            vacuum_log: CSV file of a vacuum logger.
            progress: Told the share that is done.

        Raises:
            InputError: An input does not suit this capture.
            NotFound: The run does not exist.
            AnalysisError: The points make no surface.
        """
        given = {} if inputs is None else document_of(inputs)
        log = None if vacuum_log is None else read_table_text(Path(vacuum_log))
        source = "the program" if inputs is None or isinstance(inputs, Mapping) else str(inputs)
        made = analyse_file(
            progress,
            path=self.path,
            inputs=with_log(given, log),
            bursts=[Path(one) for one in bursts],
            sources={**dict.fromkeys(given, source), **({"vacuum.log": str(vacuum_log)} if log else {})},
            options=AnalysisOptions(run=run),
        )
        return Analysis(made)


def open_capture(path: PathLike) -> Capture:
    """Opens a capture file.

    Args:
        path: The file, NAME.grab, or NAME.grab.part while it is being recorded.

    Raises:
        CaptureFileError: It is missing, damaged, not a capture, or of a later version.
    """
    return Capture(path)
