"""The tables of an analysis in every format: the same numbers, with their units."""

import csv
import json

import numpy as np
import pytest

from archive.mat_files import by_matio
from core.chain.milking import analysed, grid, still, whole
from grabberd.archive.export.mat_file import LONGEST_NAME
from grabberd.errors import ExtraMissing, InputError, StorageError
from grabberd_liner.analyses.export import HDF5_NAME, MAT_NAME, check_formats, write_analysis, write_csv
from grabberd_liner.chain.analysis.columns import TABLES
from grabberd_liner.chain.analysis.tables import tables

ABOUT = {"id": "milking", "run": 1, "site": {"barn": "Ås"}}


@pytest.fixture(scope="module")
def made():
    return tables(whole())


@pytest.fixture(scope="module")
def folder(made, tmp_path_factory):
    folder = tmp_path_factory.mktemp("tables")
    write_csv(folder, made)
    return folder


@pytest.fixture(scope="module")
def hdf5(made, tmp_path_factory):
    h5py = pytest.importorskip("h5py")
    (path,) = write_analysis(tmp_path_factory.mktemp("hdf5"), made, grid(), ABOUT, ("hdf5",))
    with h5py.File(path) as file:
        yield file


@pytest.fixture(scope="module")
def parquet(made, tmp_path_factory):
    pq = pytest.importorskip("pyarrow.parquet")
    files = write_analysis(tmp_path_factory.mktemp("parquet"), made, grid(), ABOUT, ("parquet",))
    return {path.stem: pq.read_table(path) for path in files}


def same(found, column, table):
    """Asserts that these are the column's values; NaN equals NaN."""
    values = table.column(column.name)
    if column.dtype == "U":
        assert list(found) == values.tolist()
    else:
        np.testing.assert_array_equal(np.asarray(found, column.dtype), values)


# --- CSV ---


@pytest.mark.parametrize("name", TABLES)
def test_csv_has_every_column_and_row_to_seven_digits(folder, made, name):
    with (folder / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        head, *rows = csv.reader(file)
    assert head == [column.name for column in made[name].columns]
    assert len(rows) == len(made[name])
    for column, texts in zip(made[name].columns, zip(*rows, strict=True), strict=False):
        values = made[name].column(column.name)
        if column.dtype == "f8":
            found = [float(text) if text else np.nan for text in texts]
            np.testing.assert_allclose(found, values, rtol=1e-6, atol=0)
        else:
            assert list(texts) == [str(value) for value in values.tolist()]


def test_a_number_that_there_is_not_is_empty_in_csv(folder, made):
    assert np.isnan(made["targets"].column("contact_kpa")).any()
    text = (folder / "targets.csv").read_text()
    assert "nan" not in text.lower().replace("nan ", "")
    assert ",," in text


# --- HDF5 ---


@pytest.mark.parametrize("name", TABLES)
def test_hdf5_has_a_plain_array_with_unit_and_meaning_for_every_column(hdf5, made, name):
    assert hdf5[name].attrs["meaning"] == made[name].meaning
    assert list(hdf5[name]) == [column.name for column in made[name].columns]
    for column in made[name].columns:
        stored = hdf5[name][column.name]
        assert stored.dtype.fields is None
        assert stored.shape == (len(made[name]),)
        assert (stored.attrs["unit"], stored.attrs["meaning"]) == (column.unit, column.meaning)
        same(stored.asstr()[()] if column.dtype == "U" else stored[()], column, made[name])


def test_the_units_in_hdf5_are_those_of_the_field(hdf5):
    units = {"kappa1_per_m": "1/m", "tension1_n_per_m": "N/m", "contact_kpa": "kPa", "strain1": "1"}
    for name, unit in units.items():
        assert hdf5["targets"][name].attrs["unit"] == unit
        assert hdf5["targets"][f"sigma_{name}"].attrs["unit"] == unit


def test_hdf5_has_the_grid_and_says_what_it_was_made_from(hdf5):
    assert json.loads(hdf5.attrs["grabberd"]) == ABOUT
    np.testing.assert_array_equal(hdf5["grid"]["triangles"], grid().triangles)
    np.testing.assert_array_equal(hdf5["grid"]["target"], grid().target)
    assert "counted from 0" in hdf5["grid"].attrs["meaning"]


# --- MAT ---


@pytest.fixture(scope="module")
def mat(made, tmp_path_factory):
    (path,) = write_analysis(tmp_path_factory.mktemp("mat"), made, grid(), ABOUT, ("mat",))
    return by_matio(path)


@pytest.mark.parametrize("name", TABLES)
def test_mat_has_a_struct_of_columns_for_every_table(mat, made, name):
    assert list(mat[name]) == [column.name for column in made[name].columns]
    for column in made[name].columns:
        stored = mat[name][column.name]
        if column.dtype == "U":
            assert [str(one) for one in stored] == made[name].column(column.name).tolist()
        else:
            assert stored.shape == (len(made[name]), 1), "struct2table takes columns alone"
            assert stored.dtype == np.float64
            np.testing.assert_array_equal(stored.ravel(), made[name].column(column.name))


@pytest.mark.parametrize("name", TABLES)
def test_mat_has_unit_and_meaning_of_every_column(mat, made, name):
    assert mat["units"][name] == {column.name: column.unit for column in made[name].columns}
    assert mat["meanings"][name] == {column.name: column.meaning for column in made[name].columns}
    assert mat["meanings"]["tables"][name] == made[name].meaning


def test_triangles_in_mat_count_from_one_as_matlab_does(mat):
    np.testing.assert_array_equal(mat["grid"]["triangles"], grid().triangles + 1)
    np.testing.assert_array_equal(mat["grid"]["target"].ravel(), grid().target)
    assert "counted from 1" in mat["meanings"]["tables"]["grid"]


def test_mat_says_what_it_was_made_from(mat):
    assert (mat["about"]["id"], mat["about"]["run"], mat["about"]["site"]) == ("milking", 1, [["barn", "Ås"]])


def test_every_name_is_one_that_matlab_takes(made):
    names = [*made, *(column.name for table in made.values() for column in table.columns)]
    assert all(name.isidentifier() and name.isascii() and not name.startswith("_") for name in names)
    assert max(map(len, names)) <= LONGEST_NAME


def test_a_table_that_mat_has_no_room_for_is_refused_by_name_and_leaves_no_file(tmp_path, made, monkeypatch):
    monkeypatch.setattr("grabberd.archive.export.mat_file.MOST_BYTES", 100_000)
    with pytest.raises(InputError, match=r"`\w+` would take .* GB") as refused:
        write_analysis(tmp_path, made, grid(), ABOUT, ("csv", "mat"))
    assert "hdf5" in refused.value.hint
    assert not (tmp_path / MAT_NAME).exists()
    assert (tmp_path / "fields.csv").exists()


# --- Parquet ---


@pytest.mark.parametrize("name", TABLES)
def test_parquet_has_every_column_with_unit_and_description(parquet, made, name):
    assert parquet[name].column_names == [column.name for column in made[name].columns]
    for column in made[name].columns:
        said = parquet[name].schema.field(column.name).metadata
        assert said == {b"unit": column.unit.encode(), b"description": column.meaning.encode()}
        same(parquet[name][column.name].to_pylist(), column, made[name])


def test_parquet_says_what_it_was_made_from(parquet):
    told = parquet["fields"].schema.metadata
    assert json.loads(told[b"grabberd"]) == ABOUT
    assert told[b"description"] == TABLES["fields"].meaning.encode()


# --- all together ---


def test_an_analysis_of_the_shape_alone_is_written_in_every_format(tmp_path):
    for name in ("h5py", "pyarrow"):
        pytest.importorskip(name)
    made = tables(analysed(still(3)))
    written = write_analysis(tmp_path, made, grid(), ABOUT, ("csv", "parquet", "hdf5", "vtu", "ply", "mat"))
    assert len(written) == 2 * len(TABLES) + 4
    assert all(path.exists() for path in written)
    assert (tmp_path / "phases.csv").read_text().count("\n") == 1


def test_nothing_is_overwritten(tmp_path, made):
    (tmp_path / "fields.csv").write_text("mine")
    with pytest.raises(StorageError, match=r"fields\.csv"):
        write_analysis(tmp_path, made, grid(), ABOUT, ("csv",))
    assert (tmp_path / "fields.csv").read_text() == "mine"


def test_an_unknown_format_is_refused_by_name():
    with pytest.raises(InputError, match="xlsx") as caught:
        check_formats(["csv", "xlsx"])
    assert "parquet" in caught.value.hint


@pytest.mark.parametrize(("kind", "extra"), [("parquet", "parquet"), ("hdf5", "hdf5")])
def test_without_the_optional_part_it_says_how_to_install_it(tmp_path, made, monkeypatch, kind, extra):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(ExtraMissing) as caught:
        write_analysis(tmp_path, made, grid(), ABOUT, (kind,))
    assert caught.value.hint == f"install it: pip install 'grabberd[{extra}]'"
    assert not (tmp_path / HDF5_NAME).exists()
    check_formats(["csv", "vtu", "ply"])
