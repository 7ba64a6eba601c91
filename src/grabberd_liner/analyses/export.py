"""Files of an analysis in a folder, in the formats that are asked for: tables, and the wall of each analysed
field and phase as a mesh with the columns of its targets at the vertices.

VTU, the unstructured grids of VTK that ParaView opens, and their series in time as PVD:
https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html
"""

import base64
import json
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from grabberd import __version__
from grabberd.archive.export.hdf5_file import ArrayGroup, check_hdf5, write_hdf5
from grabberd.archive.export.mat_file import (
    Struct,
    described,
    mat_check,
    mat_column,
    mat_value,
    table_struct,
    write_mat,
)
from grabberd.archive.export.read_back import csv_check, hdf5_check, parquet_check, ply_check, xml_check
from grabberd.archive.export.table_files import (
    check_parquet,
    csv_text,
    ply_head,
    ply_triangles,
    ply_vertices,
    write_parquet,
)
from grabberd.core.chain.columns import Column, Rows, Table
from grabberd.errors import InputError
from grabberd.files.checked_file import checked_file, checked_path, write_checked
from grabberd.files.disk import storage_errors
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.chain.analysis.tables import AnalysisTables

Array = NDArray[Any]
_POSITION = ("x_mm", "y_mm", "z_mm")
_TABLES = {"targets": ("fields", "n", "field-{:08d}"), "phase_targets": ("phases", "phase", "phase-{:.4f}")}


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """The wall at one field or phase; targets without a position are left out.

    Attributes:
        series: `fields` or `phases`.
        name: Name of its file, without ending.
        time: Time in s, or phase.
        triangles: (K, 3) counter-clockwise as seen from outside.
        position: Columns x_mm, y_mm, z_mm: the targets on the smooth outer face, object's frame.
        columns: Columns of the values at the targets.
        rows: (M,) values of `position` and `columns`.
    """

    series: str
    name: str
    time: float
    triangles: Array
    position: tuple[Column, ...]
    columns: tuple[Column, ...]
    rows: Rows

    def __len__(self) -> int:
        return len(self.rows[_POSITION[0]])

    @property
    def xyz_mm(self) -> Array:
        """(M, 3) positions of the targets."""
        return np.column_stack([self.rows[column.name] for column in self.position])


def meshes(tables: AnalysisTables, grid: Grid) -> Iterator[Mesh]:
    """The meshes of the fields, then those of the phases."""
    for name in _TABLES:
        for first in range(0, len(tables[name]), len(grid)):
            yield _mesh(tables[name], slice(first, first + len(grid)), grid.triangles)


def _mesh(table: Table, part: slice, triangles: Array) -> Mesh:
    series, key, file_name = _TABLES[table.name]
    which = table.column(key)[part][0]
    time = table.column("time_s")[part][0] if "time_s" in table.rows else which
    numeric = [column for column in table.columns if column.dtype[0] in "if"]
    positions: Array = np.array([table.column(name)[part] for name in _POSITION])
    seen = np.asarray(np.isfinite(positions).all(axis=0))
    vertex = np.cumsum(seen) - 1
    return Mesh(
        series,
        file_name.format(which),
        float(time),
        vertex[triangles[seen[triangles].all(axis=1)]],
        tuple(column for column in numeric if column.name in _POSITION),
        tuple(column for column in numeric if column.name not in (key, "time_s", *_POSITION)),
        {column.name: table.column(column.name)[part][seen] for column in numeric},
    )


TRIANGLE = 5
"""VTK's number of the cell type."""
_TYPES = {"f": ("Float64", "<f8"), "i": ("Int64", "<i8"), "u": ("UInt8", "u1")}
_HEAD = (
    '<?xml version="1.0"?>\n'
    '<VTKFile type="{}" version="1.0" byte_order="LittleEndian" header_type="UInt64">\n'
)


def vtu(mesh: Mesh) -> bytes:
    """A VTU file: triangles, with the mesh's columns as values at their corners."""
    cells = {
        "connectivity": mesh.triangles.ravel(),
        "offsets": np.arange(3, 3 * len(mesh.triangles) + 1, 3),
        "types": np.full(len(mesh.triangles), TRIANGLE, np.uint8),
    }
    lines = (
        _HEAD.format("UnstructuredGrid"),
        "<UnstructuredGrid>\n",
        f'<Piece NumberOfPoints="{len(mesh)}" NumberOfCells="{len(mesh.triangles)}">\n',
        "<Points>\n",
        _data_array("place_mm", mesh.xyz_mm, 3),
        "</Points>\n<Cells>\n",
        *(_data_array(name, values) for name, values in cells.items()),
        "</Cells>\n<PointData>\n",
        *(_data_array(column.name, mesh.rows[column.name]) for column in mesh.columns),
        "</PointData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n",
    )
    return "".join(lines).encode()


def pvd(files: Iterable[tuple[float, str]]) -> bytes:
    """A PVD file: a series of files by their times."""
    sets = (f'<DataSet timestep="{time!r}" part="0" file={quoteattr(name)}/>\n' for time, name in files)
    text = _HEAD.format("Collection") + "<Collection>\n" + "".join(sets) + "</Collection>\n</VTKFile>\n"
    return text.encode()


def _data_array(name: str, values: Array, components: int = 1) -> str:
    """Base64 of the number of bytes and the bytes."""
    vtk_type, kind = _TYPES[values.dtype.kind]
    data = values.astype(kind).tobytes()
    text = base64.b64encode(np.uint64(len(data)).tobytes() + data).decode()
    head = f'type="{vtk_type}" Name={quoteattr(name)} NumberOfComponents="{components}" format="binary"'
    return f"<DataArray {head}>{text}</DataArray>\n"


HDF5_NAME, MAT_NAME = "analysis.h5", "analysis.mat"
_GRID = ("target", "row", "column", "nominal_mm", "u_mm", "v_mm", "triangles")
_GRID_MEANING = "the targets; a triangle's corners are places in `target`, counted from {}"


class _Analysis(NamedTuple):
    tables: AnalysisTables
    grid: Grid
    about: Mapping[str, Any]


def check_formats(
    formats: Collection[str], known: Collection[str] | None = None, subject: str = "an analysis"
) -> None:
    """Checks that all formats can be written, before any work is done for them.

    Args:
        formats: Those that are asked for.
        known: Those that there are; default: `ANALYSIS_FORMATS`.
        subject: What is to be written.

    Raises:
        InputError: One is unknown.
        ExtraMissing: The library for one is not installed.
    """
    choice = known or ANALYSIS_FORMATS
    if unknown := sorted(set(formats) - set(choice)):
        raise InputError(
            f"{subject} cannot be written as {', '.join(unknown)}", f"choose from {', '.join(choice)}"
        )
    for one in formats:
        if one in _CHECKS:
            _CHECKS[one]()


def write_analysis(
    folder: Path, tables: AnalysisTables, grid: Grid, about: Mapping[str, Any], formats: Collection[str]
) -> list[Path]:
    """Writes an analysis into an existing folder; returns the files, and of meshes their folders.

    Args:
        folder: Gets CSV, Parquet, HDF5 and MAT files, and meshes in the folders `vtu` and `ply`.
        tables: Tables of the analysis.
        grid: Its target grid.
        about: What it was made from, for the formats that have room for it.
        formats: Any of `ANALYSIS_FORMATS`.

    Raises:
        InputError, ExtraMissing: See `check_formats`; or a MAT-file has no room for a table.
        StorageError: A file cannot be written, or exists already.
    """
    check_formats(formats)
    analysis = _Analysis(tables, grid, about)
    return [path for one in ANALYSIS_FORMATS if one in formats for path in _WRITERS[one](folder, analysis)]


def write_tables(
    folder: Path, tables: Mapping[str, Table], about: Mapping[str, Any], formats: Collection[str]
) -> list[Path]:
    """Writes tables alone, such as a study's, into an existing folder; returns the files.

    Args:
        folder: Gets a file for each table and format.
        tables: The tables.
        about: Their origin, for the formats that have room for it.
        formats: Any of `TABLE_FORMATS`.

    Raises:
        ExtraMissing: The library for one is not installed.
        StorageError: A file cannot be written, or exists already.
    """
    written = write_csv(folder, tables) if "csv" in formats else []
    return written + (write_parquet_files(folder, tables, about) if "parquet" in formats else [])


def write_csv(folder: Path, tables: AnalysisTables) -> list[Path]:
    """Writes a CSV file for each table.

    Raises:
        StorageError: A file cannot be written, or exists already.
    """
    return [
        write_checked(
            folder / f"{table.name}.csv",
            map(str.encode, csv_text(table.columns, table.parts())),
            csv_check(_names(table), table.__len__),
        )
        for table in tables.values()
    ]


def write_parquet_files(folder: Path, tables: AnalysisTables, about: Mapping[str, Any]) -> list[Path]:
    """Writes a Parquet file for each table.

    Raises:
        ExtraMissing: pyarrow is not installed.
        StorageError: A file cannot be written, or exists already.
    """
    paths = []
    for table in tables.values():
        path = folder / f"{table.name}.parquet"
        with checked_file(path, parquet_check(_names(table), table.__len__)) as file:
            metadata = {"description": table.meaning, "grabberd": json.dumps(about, ensure_ascii=False)}
            write_parquet(file, table.columns, [table.rows], metadata)
        paths.append(path)
    return paths


def _names(table: Table) -> list[str]:
    return [column.name for column in table.columns]


def _hdf5(folder: Path, analysis: _Analysis) -> list[Path]:
    grid: ArrayGroup = (_GRID_MEANING.format(0), {name: getattr(analysis.grid, name) for name in _GRID})
    tables, path = analysis.tables, folder / HDF5_NAME
    columns = {name: table.columns for name, table in tables.items()}
    check = hdf5_check(columns, {name: len(table) for name, table in tables.items()}, ["grid"])
    with checked_path(path, check) as part:
        write_hdf5(part, tables.values(), analysis.about, {"grid": grid})
    return [path]


def _mat(folder: Path, analysis: _Analysis) -> list[Path]:
    """`analysis.mat` with a struct for each table, and those that say what they mean."""
    variables, path = _mat_variables(analysis), folder / MAT_NAME
    with checked_path(path, mat_check(variables)) as part, part.open("xb") as file:
        write_mat(file, variables)
    return [path]


def _mat_variables(analysis: _Analysis) -> Mapping[str, Struct]:
    tables = analysis.tables.values()
    words = {table.name: described(table.columns) for table in tables}
    return {
        **{table.name: table_struct(table) for table in tables},
        "grid": _mat_grid(analysis.grid),
        "units": {name: units for name, (units, _) in words.items()},
        "meanings": {
            "tables": {table.name: table.meaning for table in tables} | {"grid": _GRID_MEANING.format(1)},
            **{name: meanings for name, (_, meanings) in words.items()},
        },
        "about": {name: mat_value(value) for name, value in analysis.about.items()},
    }


def _mat_grid(grid: Grid) -> Struct:
    arrays = {name: np.asarray(getattr(grid, name), np.float64) for name in _GRID}
    # MATLAB counts from 1, so that trisurf takes them as they are.
    arrays["triangles"] = arrays["triangles"] + 1
    return {name: values if values.ndim > 1 else mat_column(values) for name, values in arrays.items()}


def _vtu(folder: Path, analysis: _Analysis) -> list[Path]:
    """`vtu/` with a file for each field and phase, and both as series in time."""
    inner, series = _new_folder(folder / "vtu"), dict[str, list[tuple[float, str]]]()
    for mesh in meshes(analysis.tables, analysis.grid):
        elements = {"Piece": 1, "DataArray": 4 + len(mesh.columns)}
        path = write_checked(inner / f"{mesh.name}.vtu", [vtu(mesh)], xml_check(elements))
        series.setdefault(mesh.series, []).append((mesh.time, path.name))
    for name, files in series.items():
        write_checked(inner / f"{name}.pvd", [pvd(files)], xml_check({"DataSet": len(files)}))
    return [inner]


def _ply(folder: Path, analysis: _Analysis) -> list[Path]:
    """`ply/` with a file for each field and phase."""
    inner = _new_folder(folder / "ply")
    for mesh in meshes(analysis.tables, analysis.grid):
        check = ply_check(mesh.__len__, len(mesh.triangles))
        write_checked(inner / f"{mesh.name}.ply", _ply_parts(mesh, analysis.about), check)
    return [inner]


def _ply_parts(mesh: Mesh, about: Mapping[str, Any]) -> Iterable[bytes]:
    columns = (*mesh.position, *mesh.columns)
    comments = [f"grabberd {__version__}, {mesh.name}, x y z in mm"]
    if method := about.get("pressure_method"):
        comments.append(f"pressure_method {method}")
    yield ply_head(columns, len(mesh), comments, len(mesh.triangles))
    yield ply_vertices(columns, mesh.rows)
    yield ply_triangles(mesh.triangles)


def _new_folder(folder: Path) -> Path:
    with storage_errors(folder):
        folder.mkdir()
    return folder


_WRITERS: Mapping[str, Callable[[Path, _Analysis], list[Path]]] = {
    "csv": lambda folder, analysis: write_csv(folder, analysis.tables),
    "parquet": lambda folder, analysis: write_parquet_files(folder, analysis.tables, analysis.about),
    "hdf5": _hdf5,
    "vtu": _vtu,
    "ply": _ply,
    "mat": _mat,
}
ANALYSIS_FORMATS, TABLE_FORMATS = tuple(_WRITERS), ("csv", "parquet")
_CHECKS: Mapping[str, Callable[[], None]] = {"parquet": check_parquet, "hdf5": check_hdf5}
