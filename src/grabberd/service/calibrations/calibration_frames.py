"""The calibration frames that come with the program, by name."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from grabberd.config import shipped_configs
from grabberd.documents.calibrations import CalibrationFrameRow
from grabberd.errors import NotFound
from grabberd.service.setup import read_yaml


def known_frames() -> dict[str, Path]:
    """The files in `calibration-frames`, by their name without ending."""
    return {path.stem: path for path in sorted((shipped_configs() / "calibration-frames").glob("*.yaml"))}


def frame_rows() -> list[CalibrationFrameRow]:
    """The calibration frames that are known, by name."""
    return [_row(name, path) for name, path in known_frames().items()]


@cache
def _row(name: str, path: Path) -> CalibrationFrameRow:
    """The properties that tell one from another; cached, as the files never change while the program runs."""
    document = read_yaml(path)
    targets = document["targets"]
    spans = {axis: [target[axis] for target in targets] for axis in ("x_mm", "y_mm")}
    return CalibrationFrameRow(
        name=name,
        targets=len(targets),
        target_diameter_mm=document["target_diameter_mm"],
        size_mm=sorted((round(max(span) - min(span), 1) for span in spans.values()), reverse=True),
    )


def frame_document(frame: str | Mapping[str, Any] | None) -> dict[str, Any]:
    """A calibration frame's document: as it is given, by its name, or the one there is.

    A name is looked up among those known, so none ever becomes a path.

    Raises:
        NotFound: there is none of that name, or the name is needed.
        InputError: its file cannot be read.
    """
    if isinstance(frame, Mapping):
        return dict(frame)
    known = known_frames()
    if frame is None and len(known) == 1:
        return read_yaml(next(iter(known.values())))
    name = (frame or "").removesuffix(".yaml")
    if name not in known:
        said = "no calibration frame is named" if frame is None else f"no calibration frame {frame!r}"
        names = ", ".join(known) or "none is installed"
        raise NotFound(said, f"name one of: {names}; or give its document, with its targets")
    return read_yaml(known[name])
