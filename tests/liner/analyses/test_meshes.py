"""Meshes of an analysis, read back as ParaView and MeshLab read them."""

import base64
import re
from xml.etree import ElementTree

import numpy as np
import pytest

from core.chain.milking import analysed, changed, grid, still, whole
from grabberd_liner.analyses.export import meshes, write_analysis
from grabberd_liner.chain.analysis.tables import tables

VTK = {"Float64": "<f8", "Int64": "<i8", "UInt8": "u1"}
PLY = {"double": "<f8", "int": "<i4"}


def read_vtu(path):
    """Arrays by name, as the VTK file format describes them."""
    root = ElementTree.fromstring(path.read_text())
    assert root.attrib == {
        "type": "UnstructuredGrid",
        "version": "1.0",
        "byte_order": "LittleEndian",
        "header_type": "UInt64",
    }
    piece = root.find("UnstructuredGrid/Piece")
    found = {array.get("Name"): data(array) for array in piece.iter("DataArray")}
    assert len(found["place_mm"]) == int(piece.get("NumberOfPoints"))
    assert len(found["types"]) == len(found["offsets"]) == int(piece.get("NumberOfCells"))
    return found, [array.get("Name") for array in piece.find("PointData")]


def data(array):
    raw = base64.b64decode(array.text)
    assert int.from_bytes(raw[:8], "little") == len(raw) - 8
    components = int(array.get("NumberOfComponents"))
    values = np.frombuffer(raw[8:], VTK[array.get("type")])
    return values.reshape(-1, components) if components > 1 else values


def read_ply(path):
    """Vertices and faces."""
    head, _, body = path.read_bytes().partition(b"end_header\n")
    lines = head.decode("ascii").splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    kinds = [line.split()[1:] for line in lines if re.match(r"property (double|int) ", line)]
    assert lines[-1] == "property list uchar int vertex_indices"
    vertices, faces = (
        int(next(line for line in lines if line.startswith(f"element {one}")).split()[2])
        for one in ("vertex", "face")
    )
    vertex = np.dtype([(name, PLY[kind]) for kind, name in kinds])
    face = np.dtype([("count", "u1"), ("corners", "<i4", 3)])
    assert len(body) == vertices * vertex.itemsize + faces * face.itemsize
    return np.frombuffer(body, vertex, vertices), np.frombuffer(body, face, faces, vertices * vertex.itemsize)


@pytest.fixture(scope="module")
def made():
    return tables(whole())


@pytest.fixture(scope="module")
def folder(made, tmp_path_factory):
    folder = tmp_path_factory.mktemp("meshes")
    write_analysis(folder, made, grid(), {"pressure_method": "equilibrium"}, ("vtu", "ply"))
    return folder


def of_field(made, n, name):
    table = made["targets"]
    return table.column(name)[table.column("n") == n]


def test_there_is_a_mesh_for_each_field_and_phase(folder):
    for kind in ("vtu", "ply"):
        names = {path.name for path in (folder / kind).glob(f"*.{kind}")}
        fields = {f"field-{n:08d}.{kind}" for n in range(52) if n not in {20, 21}}
        assert names == fields | {f"phase-{phase:.4f}.{kind}" for phase in (0, 0.25, 0.5, 0.75)}


def test_vtu_has_the_targets_their_triangles_and_their_values(folder, made):
    found, values = read_vtu(folder / "vtu" / "field-00000030.vtu")
    np.testing.assert_array_equal(found["place_mm"][:, 2], of_field(made, 30, "z_mm"))
    np.testing.assert_array_equal(found["connectivity"].reshape(-1, 3), grid().triangles)
    np.testing.assert_array_equal(found["offsets"], np.arange(1, len(grid().triangles) + 1) * 3)
    assert set(found["types"]) == {5}
    assert {"target", "row", "kappa1_per_m", "sigma_strain2", "contact_kpa"} < set(values)
    for name in values:
        np.testing.assert_array_equal(found[name], of_field(made, 30, name))


def test_the_series_has_every_mesh_at_its_time(folder, made):
    for name, times in (("fields", made["fields"].column("time_s")), ("phases", [0, 0.25, 0.5, 0.75])):
        sets = ElementTree.fromstring((folder / "vtu" / f"{name}.pvd").read_text()).findall(
            "Collection/DataSet"
        )
        assert [float(one.get("timestep")) for one in sets] == list(times)
        assert all((folder / "vtu" / one.get("file")).is_file() for one in sets)


def test_ply_has_the_same(folder, made):
    vertices, faces = read_ply(folder / "ply" / "field-00000030.ply")
    np.testing.assert_array_equal(faces["corners"], grid().triangles)
    assert set(faces["count"]) == {3}
    for axis in "xyz":
        np.testing.assert_array_equal(vertices[axis], of_field(made, 30, f"{axis}_mm"))
    for name in vertices.dtype.names[3:]:
        np.testing.assert_array_equal(vertices[name], of_field(made, 30, name))


def test_ply_says_how_pressures_were_found(folder):
    assert b"\ncomment pressure_method equilibrium\n" in (folder / "ply" / "field-00000030.ply").read_bytes()


def test_triangles_are_counter_clockwise_as_seen_from_outside(made):
    for mesh in meshes(made, grid()):
        a, b, c = np.moveaxis(mesh.xyz_mm[mesh.triangles], 1, 0)
        outward = (a + b + c) / 3 - [0, 0, -20]
        outward[:, 0] = 0
        assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), outward) > 0).all()


def test_a_hole_is_a_hole_in_the_mesh():
    hole = (grid().row >= 2) & (grid().row <= 4) & (grid().column >= 1)
    seen = next(meshes(tables(analysed([changed(one, keep=~hole) for one in still(3)])), grid()))
    assert len(seen.xyz_mm) < len(grid())
    assert 0 < len(seen.triangles) < len(grid().triangles)
    assert seen.triangles.max() < len(seen.xyz_mm)
    assert np.isfinite(seen.xyz_mm).all()
