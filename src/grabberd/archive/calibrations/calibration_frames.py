"""Calibration frames: the ones that come with the program, by name, and the keys of their documents."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType

from grabberd.config import shipped_configs
from grabberd.core.geometry import Reading
from grabberd.core.reconstruction import ObjectModel
from grabberd.core.reconstruction.object_model import FileKey
from grabberd.documents.calibrations import CalibrationFrameRow
from grabberd.documents.document import JsonObject
from grabberd.errors import NotFound
from grabberd.files.documents import read_yaml

CALIBRATION_FRAME_KEYS: Mapping[str, FileKey] = MappingProxyType(
    {
        "certificate": FileKey(
            "anything",
            "",
            "none",
            "Number, laboratory, date; stored with every calibration and shown in its report.",
        ),
        "temperature_C": FileKey(
            "number", "°C", "none", "Temperature at which they were measured; stored and shown likewise."
        ),
        "check_length": FileKey(
            "mapping",
            "",
            "none",
            "Distance between two targets, certified independently of the positions: only this reveals a "
            "file whose scale is wrong.",
        ),
    }
)
"""Additional keys of a calibration frame's document, compared with an object model."""


def known_calibration_frames() -> dict[str, Path]:
    """Returns the files in `calibration-frames`, by name without suffix."""
    return {path.stem: path for path in sorted((shipped_configs() / "calibration-frames").glob("*.yaml"))}


def calibration_frame_rows() -> list[CalibrationFrameRow]:
    """The known calibration frames."""
    return [_row(name, path) for name, path in known_calibration_frames().items()]


@cache
def _row(name: str, path: Path) -> CalibrationFrameRow:
    """The distinguishing properties; cached, as the files never change while the program runs."""
    document = read_yaml(path)
    targets = document["targets"]
    spans = {axis: [target[axis] for target in targets] for axis in ("x_mm", "y_mm")}
    return CalibrationFrameRow(
        name=name,
        targets=len(targets),
        target_diameter_mm=document["target_diameter_mm"],
        size_mm=sorted((round(max(span) - min(span), 1) for span in spans.values()), reverse=True),
    )


def calibration_frame_document(wanted: str | JsonObject | None) -> JsonObject:
    """Returns a calibration frame's document: as given, by name, or the only one there is.

    Raises:
        NotFound: No calibration frame has that name, or a name is needed.
        InputError: The file cannot be read.
    """
    if isinstance(wanted, Mapping):
        return dict(wanted)
    # The name may come from a client: it is looked up, never made part of a path.
    known = known_calibration_frames()
    if wanted is None and len(known) == 1:
        return read_yaml(next(iter(known.values())))
    name = (wanted or "").removesuffix(".yaml")
    if name not in known:
        problem = "no calibration frame is named" if wanted is None else f"no calibration frame {wanted!r}"
        names = ", ".join(known) or "none is installed"
        raise NotFound(problem, f"name one of: {names}; or give its document, with its targets")
    return read_yaml(known[name])


def calibration_frame_model(document: JsonObject) -> ObjectModel:
    """Returns the targets of a calibration frame's document.

    Raises:
        InputError: The document is invalid.
    """
    what = "the calibration frame's file"
    reading = Reading(what)
    if document.get("temperature_C") is not None:
        reading.number(document, "temperature_C")
    reading.finish("give the temperature at which the positions were measured in °C, or leave the key out")
    own = {key: document[key] for key in document if key not in CALIBRATION_FRAME_KEYS}
    return ObjectModel.from_document(own, what)
