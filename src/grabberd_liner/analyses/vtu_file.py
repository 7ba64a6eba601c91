"""Meshes as VTU, the unstructured grids of VTK that ParaView opens, and their series in time as PVD.

The format: https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html
"""

import base64
from collections.abc import Iterable
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analyses.meshes import Mesh

Array = NDArray[Any]
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
