"""A capture file as the instrument's library has it, which can also be analysed."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from grabberd.archive.input_files import read_vacuum_log
from grabberd.library import capture
from grabberd.library.calibrations import Progress
from grabberd.library.documents import PathLike, document_of
from grabberd.library.threads import one_thread
from grabberd_liner.analyses.job import AnalysisOptions, analyse_file, with_log
from grabberd_liner.analyses.library import Analysis


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
        log = None if vacuum_log is None else read_vacuum_log(Path(vacuum_log))
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
