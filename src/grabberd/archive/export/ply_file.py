"""Tables as vertices of a PLY file (binary, little-endian), with or without triangles between them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd.core.chain.columns import Column, Rows

PLY_TYPES = {"i4": "int", "i8": "int", "f4": "float", "f8": "double"}
"""PLY's name of a column's type; it has no integers of 64 bits."""
PLY_NAMES = {"x_mm": "x", "y_mm": "y", "z_mm": "z"}
"""The names that programs look for when they draw vertices."""

_NUMPY = {"int": "<i4", "float": "<f4", "double": "<f8"}
_FACE = np.dtype([("count", "u1"), ("corners", "<i4", 3)])


def ply_head(
    columns: Sequence[Column], vertices: int, comments: Sequence[str], triangles: int | None = None
) -> bytes:
    """The head of a file; `triangles` is their number in a mesh, None for a cloud."""
    faces = (f"element face {triangles}", "property list uchar int vertex_indices")
    lines = (
        "ply",
        "format binary_little_endian 1.0",
        *(f"comment {text}" for text in comments),
        f"element vertex {vertices}",
        *(f"property {PLY_TYPES[one.dtype]} {PLY_NAMES.get(one.name, one.name)}" for one in columns),
        *(faces if triangles is not None else ()),
        "end_header\n",
    )
    return "\n".join(lines).encode("ascii", "replace")


def ply_vertex(columns: Sequence[Column]) -> np.dtype[np.void]:
    """The type of one vertex."""
    return np.dtype([(column.name, _NUMPY[PLY_TYPES[column.dtype]]) for column in columns])


def ply_vertices(columns: Sequence[Column], rows: Rows) -> bytes:
    """The vertices of one part of a table."""
    vertices = np.empty(len(rows[columns[0].name]), ply_vertex(columns))
    for column in columns:
        vertices[column.name] = rows[column.name]
    return vertices.tobytes()


def ply_triangles(triangles: NDArray[Any]) -> bytes:
    """The triangles of a mesh, (K, 3) indices of vertices."""
    faces = np.empty(len(triangles), _FACE)
    faces["count"], faces["corners"] = 3, triangles
    return faces.tobytes()
