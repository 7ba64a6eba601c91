"""Points column by column, as JSON or as one binary message (docs/reference/live.md), and curves."""

import struct
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from grabberd.core.channels import Quantity
from grabberd.documents.document import Document, with_examples
from grabberd.documents.examples import POINTS

PROTOCOL = "grabberd.points.v1"
"""Name of the WebSocket's subprotocol, which a client may ask for."""
MAGIC = b"GRBX"
VERSION = 1
HEADER = struct.Struct("<4sHHQqqqQII")
"""Little endian: magic, version, its size, the first six attributes of `PointsFrame`, number of points."""
UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
"""Row and column of the six values of a symmetric matrix, in the sequence in which they are sent."""
_COLUMNS = tuple(np.dtype(kind) for kind in ("<f8", "<f4", "<f4", "<f4", "<u4"))
_WIDTHS = (3, 6, 6, 1, 1)
POINT_BYTES = sum(kind.itemsize * width for kind, width in zip(_COLUMNS, _WIDTHS, strict=True))


class PointsFrame(NamedTuple):
    """The points of one field.

    Attributes:
        n: Number of the field.
        time_ns: Middle of its exposure, by the monotonic clock of the daemon's computer.
        utc_us: The same in µs since 1970 (UTC).
        published_ns: Time at which its points were there, by the monotonic clock.
        sequence: Number of the message; each that is missing is a field that this client was too slow for.
        description: Number of the description that holds for it.
        target: (N,) ids of the targets.
        xyz_mm: (N, 3), in the object's frame.
        covariance_mm2: (N, 6), xx, xy, xz, yy, yz, zz, from pointing and line jitter.
        calibration_covariance_mm2: (N, 6), from the calibration: common to all fields.
        residual_px: (N,).
    """

    n: int
    time_ns: int
    utc_us: int
    published_ns: int
    sequence: int
    description: int
    target: NDArray[np.uint32]
    xyz_mm: NDArray[np.float64]
    covariance_mm2: NDArray[np.float32]
    calibration_covariance_mm2: NDArray[np.float32]
    residual_px: NDArray[np.float32]


def encoded(frame: PointsFrame) -> bytes:
    """The message of a frame."""
    numbers = frame[: PointsFrame._fields.index("target")]
    header = HEADER.pack(MAGIC, VERSION, HEADER.size, *numbers, len(frame.target))
    columns = (
        *(frame.xyz_mm, frame.covariance_mm2, frame.calibration_covariance_mm2),
        *(frame.residual_px, frame.target),
    )
    # Column after column, the widest numbers first: every one is aligned, and a reader copies none.
    return header + b"".join(
        np.ascontiguousarray(column, kind).tobytes() for column, kind in zip(columns, _COLUMNS, strict=True)
    )


def decoded(message: bytes) -> PointsFrame:
    """The frame of a message; its arrays are read-only.

    Raises:
        ValueError: It is none, or of another version.
    """
    try:
        magic, version, size, n, time_ns, utc_us, published_ns, sequence, description, count = (
            HEADER.unpack_from(message)
        )
    except struct.error:
        magic, version, size, count = b"", 0, 0, 0
    if (magic, version) != (MAGIC, VERSION) or size < HEADER.size:
        raise ValueError("it is no message of points that this version knows")
    if len(message) != size + count * POINT_BYTES:
        raise ValueError(f"it has {len(message)} bytes, which {count} points have not")
    columns, at = [], size
    for kind, width in zip(_COLUMNS, _WIDTHS, strict=True):
        columns.append(np.frombuffer(message, kind, count * width, at))
        at += columns[-1].nbytes
    xyz_mm, covariance_mm2, calibration_covariance_mm2, residual_px, target = columns
    return PointsFrame(
        n,
        time_ns,
        utc_us,
        published_ns,
        sequence,
        description,
        target,
        xyz_mm.reshape(count, 3),
        covariance_mm2.reshape(count, 6),
        calibration_covariance_mm2.reshape(count, 6),
        residual_px,
    )


def upper(matrices: NDArray[np.float64]) -> NDArray[np.float32]:
    """(N, 6), the upper triangles of (N, 3, 3) symmetric matrices."""
    rows, columns = zip(*UPPER, strict=True)
    return matrices[:, rows, columns].astype(np.float32)


def symmetric(triangles: NDArray[np.float32]) -> NDArray[np.float64]:
    """(N, 3, 3), the symmetric matrices of (N, 6) upper triangles."""
    matrices = np.empty((len(triangles), 3, 3))
    for k, (row, column) in enumerate(UPPER):
        matrices[:, row, column] = matrices[:, column, row] = triangles[:, k]
    return matrices


class PointColumns(Document):
    """Points of one field; every list has the targets in the same sequence."""

    target: list[int]
    x_mm: list[float]
    y_mm: list[float]
    z_mm: list[float]
    sigma_x_mm: list[float] = Field(description="Standard deviation from pointing and line jitter.")
    sigma_y_mm: list[float]
    sigma_z_mm: list[float]
    calibration_sigma_x_mm: list[float] = Field(
        description="Standard deviation from the calibration; common to all fields."
    )
    calibration_sigma_y_mm: list[float]
    calibration_sigma_z_mm: list[float]
    residual_px: list[float]


class FieldPoints(PointColumns):
    """The points of one field of a capture."""

    n: int
    time_s: float = Field(description="Time since the capture's first field.")


class PointsDocument(Document):
    """Points of a run, thinned out."""

    model_config = with_examples(POINTS)

    capture: str
    run: int
    every: int = Field(description="Only fields whose number is a multiple of this are included.")
    fields: list[FieldPoints]


class NewestPoints(PointColumns):
    """The points of the newest measured field; every list has the targets in the same sequence."""

    device: str
    n: int
    utc: str = Field(description="Middle of the field's exposure.")


class PointsDescription(Document):
    """Description of the points of a stream, which holds until the next one."""

    type: Literal["description"] = "description"
    number: int = Field(description="Number by which the frames refer to it.")
    device: str
    rate_hz: float
    calibration_id: str | None = Field(description="Calibration that the fields are measured with.")
    object_name: str | None = Field(description="Object model that they are measured with.")


class LiveWidths(Document):
    """Distance between two facing targets, field by field."""

    targets: tuple[int, int]
    width_mm: list[float | None] = Field(description="Null where either target has no point.")
    sigma_mm: list[float | None] = Field(
        description="Standard deviation from pointing and line jitter, without the calibration's."
    )


class LiveChannel(Document):
    """The mean of a channel's readings, every 20 ms; there is no entry for a time without readings."""

    name: str
    quantity: Quantity
    logger: str
    time_s: list[float]
    kpa: list[float]


class LiveCurves(Document):
    """The measured fields of a device, and its channels, over the last seconds.

    All times are seconds of the monotonic clock of the daemon's computer. Messages overlap, so that one that
    is missed leaves no gap. Every list but those of the channels has a value for each field.
    """

    device: str
    now_s: float
    now_utc_s: float = Field(description="The same moment in seconds since 1970 (UTC).")
    time_s: list[float] = Field(
        description="Middle of the exposure of each field; one that was not measured is not there."
    )
    targets: dict[str, list[int]] = Field(description="Number of complete targets in each view.")
    points: list[int]
    residual_px: list[float | None] = Field(description="Root mean square over the points.")
    latency_ms: list[float | None] = Field(description="From the arrival of the field to its points.")
    widths: list[LiveWidths] = Field(
        description="Distances between targets that face each other in the middle row, the outermost first."
    )
    channels: list[LiveChannel]
