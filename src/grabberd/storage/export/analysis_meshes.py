"""The wall of each field and phase as a mesh with its values at the targets: VTU for ParaView, and PLY."""

import base64
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from grabberd import __version__
from grabberd.analysis import Grid
from grabberd.processes.analysis.tables import AnalysisTables, Table
from grabberd.storage.capture.schema import storage_errors

Array = NDArray[Any]
TRIANGLE = 5
"""VTK's number for it."""
_PLACE = ("x_mm", "y_mm", "z_mm")
_VTK_TYPES = {"f": ("Float64", "<f8"), "i": ("Int64", "<i8"), "u": ("UInt8", "u1")}
_TABLES = {"targets": ("n", "field-{:08d}"), "phase_targets": ("phase", "phase-{:.4f}")}
_HEAD = (
    '<?xml version="1.0"?>\n'
    '<VTKFile type="{}" version="1.0" byte_order="LittleEndian" header_type="UInt64">\n'
)


class Mesh(NamedTuple):
    """The wall at one field or phase; targets without a place are left out.

    Attributes:
        name: of its file; `time`: s, or the phase.
        xyz_mm: (M, 3) the targets' places on the smooth outer face, object's frame.
        triangles: (K, 3) counter-clockwise as seen from outside.
        values: at the targets, (M,) each by the name of its column.
    """

    name: str
    time: float
    xyz_mm: Array
    triangles: Array
    values: Mapping[str, Array]


def meshes(tables: AnalysisTables, grid: Grid) -> Iterator[Mesh]:
    """The fields' and then the phases'."""
    for name, (key, file_name) in _TABLES.items():
        table = tables[name]
        for first in range(0, len(table), len(grid)):
            yield _mesh(table, slice(first, first + len(grid)), grid.triangles, key, file_name)


def _mesh(table: Table, rows: slice, triangles: Array, key: str, file_name: str) -> Mesh:
    values = {one.name: one.values[rows] for one in table.columns if one.values.dtype.kind in "if"}
    which = values.pop(key)[0]
    time = values.pop("time_s", np.array([which]))[0]
    xyz = np.column_stack([values.pop(name) for name in _PLACE])
    there = np.isfinite(xyz).all(axis=1)
    place = np.cumsum(there) - 1
    whole = triangles[there[triangles].all(axis=1)]
    kept = {name: column[there] for name, column in values.items()}
    return Mesh(file_name.format(which), float(time), xyz[there], place[whole], kept)


def write_vtu(folder: Path, tables: AnalysisTables, grid: Grid) -> list[Path]:
    """A VTU file for each field and phase, and `fields.pvd` and `phases.pvd`: the same as series in time.

    Raises:
        StorageError: a file cannot be written.
    """
    written: dict[str, list[tuple[float, Path]]] = {"fields": [], "phases": []}
    for mesh in meshes(tables, grid):
        path = _written(folder / f"{mesh.name}.vtu", _vtu(mesh))
        written["fields" if mesh.name.startswith("field") else "phases"].append((mesh.time, path))
    series = [
        _written(folder / f"{name}.pvd", _series(members)) for name, members in written.items() if members
    ]
    return [*series, *(path for members in written.values() for _, path in members)]


def write_ply(folder: Path, tables: AnalysisTables, grid: Grid) -> list[Path]:
    """A PLY file (binary, little-endian) for each field and phase: vertices with their values, and triangles.

    Raises:
        StorageError: a file cannot be written.
    """
    return [_written(folder / f"{mesh.name}.ply", _ply(mesh)) for mesh in meshes(tables, grid)]


def _written(path: Path, content: bytes) -> Path:
    with storage_errors(path), path.open("xb") as file:
        file.write(content)
    return path


def _vtu(mesh: Mesh) -> bytes:
    cells = {
        "connectivity": mesh.triangles.ravel(),
        "offsets": np.arange(3, 3 * len(mesh.triangles) + 1, 3),
        "types": np.full(len(mesh.triangles), TRIANGLE, np.uint8),
    }
    lines = (
        _HEAD.format("UnstructuredGrid"),
        "<UnstructuredGrid>\n",
        f'<Piece NumberOfPoints="{len(mesh.xyz_mm)}" NumberOfCells="{len(mesh.triangles)}">\n',
        "<Points>\n",
        _data_array("place_mm", mesh.xyz_mm, 3),
        "</Points>\n<Cells>\n",
        *(_data_array(name, values) for name, values in cells.items()),
        "</Cells>\n<PointData>\n",
        *(_data_array(name, values) for name, values in mesh.values.items()),
        "</PointData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n",
    )
    return "".join(lines).encode()


def _data_array(name: str, values: Array, components: int = 1) -> str:
    """Base64 of the number of bytes and the bytes."""
    vtk_type, kind = _VTK_TYPES[values.dtype.kind]
    data = values.astype(kind).tobytes()
    text = base64.b64encode(np.uint64(len(data)).tobytes() + data).decode()
    head = f'type="{vtk_type}" Name={quoteattr(name)} NumberOfComponents="{components}" format="binary"'
    return f"<DataArray {head}>{text}</DataArray>\n"


def _series(members: list[tuple[float, Path]]) -> bytes:
    sets = (
        f'<DataSet timestep="{time!r}" part="0" file={quoteattr(path.name)}/>\n' for time, path in members
    )
    text = _HEAD.format("Collection") + "<Collection>\n" + "".join(sets) + "</Collection>\n</VTKFile>\n"
    return text.encode()


def _ply(mesh: Mesh) -> bytes:
    names = {"x": "<f8", "y": "<f8", "z": "<f8"}
    names |= {name: "<f8" if values.dtype.kind == "f" else "<i4" for name, values in mesh.values.items()}
    vertices = np.empty(len(mesh.xyz_mm), list(names.items()))
    vertices["x"], vertices["y"], vertices["z"] = mesh.xyz_mm.T
    for name, values in mesh.values.items():
        vertices[name] = values
    faces = np.empty(len(mesh.triangles), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.triangles
    return _ply_head(mesh, names).encode() + vertices.tobytes() + faces.tobytes()


def _ply_head(mesh: Mesh, names: Mapping[str, str]) -> str:
    types: Callable[[str], str] = {"<f8": "double", "<i4": "int"}.__getitem__
    lines = (
        "ply",
        "format binary_little_endian 1.0",
        f"comment grabberd {__version__}, {mesh.name}, x y z in mm",
        f"element vertex {len(mesh.xyz_mm)}",
        *(f"property {types(kind)} {name}" for name, kind in names.items()),
        f"element face {len(mesh.triangles)}",
        "property list uchar int vertex_indices",
        "end_header",
    )
    return "\n".join(lines) + "\n"
