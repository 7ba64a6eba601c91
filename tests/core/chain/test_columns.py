"""Columns: their types, their σ, and tables made of them."""

import numpy as np
import pytest

from core.chain.milking import whole
from grabberd.core.chain.columns import Column, TableSpec, joined, json_values, make_table, regrouped
from grabberd_liner.chain.analysis.columns import TABLES
from grabberd_liner.chain.analysis.tables import tables

COUNT = Column("count", "", "i8", "a count")
LENGTH = Column("length_mm", "mm", "f8", "a length", measured=True)
SPEC = TableSpec("A row for each thing", (COUNT,), (LENGTH,))


def test_a_measured_column_is_followed_by_its_sigma():
    assert [(one.name, one.unit, one.meaning) for one in SPEC.columns] == [
        ("count", "", "a count"),
        ("length_mm", "mm", "a length"),
        ("sigma_length_mm", "mm", "σ of length_mm"),
    ]


def test_a_table_has_the_values_of_its_columns():
    table = make_table("things", SPEC, {"count": [1, 2], "length_mm": ([0.5, 1.5], [0.1, 0.2])})
    assert len(table) == 2
    assert table.column("sigma_length_mm").tolist() == [0.1, 0.2]
    assert [one.dtype for one in table.columns] == ["i8", "f8", "f8"]


def test_integers_of_which_one_is_unknown_are_floats():
    table = make_table("things", SPEC, {"count": [1, np.nan], "length_mm": ([0, 0], [0, 0])})
    assert table.columns[0].dtype == "f8"
    assert json_values(table.column("count")) == [1.0, None]


def test_a_large_table_comes_in_parts():
    table = make_table("things", SPEC, {"count": np.arange(5), "length_mm": (np.arange(5.0), np.ones(5))})
    parts = list(table.parts(2))
    assert [len(rows["count"]) for rows in parts] == [2, 2, 1]
    assert joined([COUNT], parts)["count"].tolist() == [0, 1, 2, 3, 4]


def test_small_parts_become_few_large_ones():
    parts = [{"count": np.arange(first, first + 2)} for first in range(0, 10, 2)]
    found = [rows["count"].tolist() for rows in regrouped([COUNT], parts, 3)]
    assert found == [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9]]


def test_a_single_value_is_a_row():
    assert COUNT.array(3).tolist() == [3]


def test_parts_of_a_table_are_joined_in_their_order():
    parts = [{"count": np.array([1])}, {"count": np.array([2, 3])}]
    assert joined([COUNT], parts)["count"].tolist() == [1, 2, 3]


@pytest.mark.parametrize("name", TABLES)
def test_an_analysis_has_the_columns_and_types_of_its_specification(name):
    for found, specified in zip(tables(whole())[name].columns, TABLES[name].columns, strict=True):
        assert found.name == specified.name
        assert found.dtype == specified.dtype or (found.dtype, specified.dtype[0]) == ("f8", "i")


@pytest.mark.parametrize("name", TABLES)
def test_units_end_the_names(name):
    endings = {
        "1/m": "per_m",
        "N/m": "n_per_m",
        "N/mm": "n_per_mm",
        "1/min": "per_min",
        "mm²": "mm2",
        "mm³": "mm3",
        "kPa": "kpa",
        "MPa": "mpa",
        "N": "n",
        "N mm": "n_mm",
    }
    for column in TABLES[name].columns:
        if column.unit not in {"", "1"}:
            assert column.name.endswith(f"_{endings.get(column.unit, column.unit)}")


def test_a_long_text_in_one_row_costs_the_others_nothing():
    values = Column("reason", "", "U", "why").array(["", "a" * 1000] + [""] * 98)
    assert values.nbytes <= 8 * 100
    assert list(values[:2]) == ["", "a" * 1000]
