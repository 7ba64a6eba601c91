"""Maps of an analysis: each is read without the others."""

import json

import pytest

from archive.damage import damage, every_way
from core.chain.milking import grid, whole
from grabberd.errors import NotFound, StorageError
from grabberd_liner.analyses.store import MAPS, OFFSETS, read_map, write_maps
from grabberd_liner.chain.analysis.analysis_document import map_units, target_maps
from grabberd_liner.chain.analysis.tables import tables


@pytest.fixture(scope="module")
def made():
    return tables(whole())


@pytest.fixture(scope="module")
def folder(made, tmp_path_factory):
    folder = tmp_path_factory.mktemp("maps")
    write_maps(folder, target_maps(made, grid()), map_units(made))
    return folder


def test_a_fields_map_has_its_rows_of_the_table_to_six_digits(folder, made):
    found = json.loads(read_map(folder, "field", 30))
    assert (found["field"], found["phase"]) == (30, None)
    rows = made["targets"].column("n") == 30
    for column in made["targets"].columns:
        if column.name not in ("n", "time_s"):
            known = made["targets"].column(column.name)[rows].tolist()
            values = [value if value == value else None for value in known]  # noqa: PLR0124
            if column.dtype == "f8":
                values = [None if value is None else pytest.approx(value, rel=1e-5) for value in values]
            assert found["columns"][column.name] == values


def test_every_column_has_its_unit(folder):
    found = json.loads(read_map(folder, "field", 0))
    assert set(found["units"]) == set(found["columns"])
    assert found["units"]["kappa1_per_m"] == "1/m"


def test_the_nearest_phase_is_found_the_cycle_going_round(folder):
    for asked, nearest in ((0.0, 0.0), (0.3, 0.25), (0.95, 0.0), (1.0, 0.0), (0.7, 0.75)):
        assert json.loads(read_map(folder, "phase", asked))["phase"] == nearest


def test_a_field_that_was_not_analysed_has_none(folder):
    with pytest.raises(NotFound, match="no field 20") as caught:
        read_map(folder, "field", 20)
    assert caught.value.hint == "choose from 0 to 51"


def test_where_there_is_no_mean_cycle_there_is_no_phase(tmp_path):
    write_maps(tmp_path, (), {})
    with pytest.raises(NotFound, match=r"no phase 0\.5"):
        read_map(tmp_path, "phase", 0.5)


@every_way
@pytest.mark.parametrize("name", [MAPS, OFFSETS])
def test_maps_damaged_before_they_are_read_back_are_refused(made, tmp_path, monkeypatch, spoil, name):
    damage(monkeypatch, spoil, name)
    with pytest.raises(StorageError, match=f"{name} reads back other than it was written"):
        write_maps(tmp_path, target_maps(made, grid()), map_units(made))
    assert not (tmp_path / name).exists()
