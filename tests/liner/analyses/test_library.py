"""An analysis as a Python program has it."""

from pathlib import Path

import numpy as np
import pytest

import grabberd
from grabberd.errors import InputError

SHAPE = {"reference": {"phase": 0.3}, "plane": "symmetry", "heights_mm": [0], "average": 4}


@pytest.fixture(scope="module")
def found() -> grabberd.Analysis:
    return grabberd.open(grabberd.example("liner.grab")).analyse(SHAPE)


def test_quantities_have_a_sigma_or_a_reason(found: grabberd.Analysis) -> None:
    rate = found.quantities["rate_per_min"]
    assert (rate.unit, abs(rate.value - 60.0) < 4 * rate.sigma) == ("1/min", True)
    load = found.quantities["teat_load_n"]
    assert np.isnan(load.value)
    assert load.reason
    assert any("material" in one for one in found.lacks)


def test_a_vacuum_log_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.csv cannot be read"):
        grabberd.open(grabberd.example("liner.grab")).analyse(SHAPE, vacuum_log=tmp_path / "none.csv")


def test_tables_have_units(found: grabberd.Analysis) -> None:
    fields = found["fields"]
    assert (fields.units["area_mm2"], len(fields), "sections" in found.tables) == ("mm²", 32, True)
    with pytest.raises(InputError, match="no table 'strains'") as caught:
        found["strains"]
    assert "targets" in caught.value.hint


def test_a_map_has_a_place_for_each_target(found: grabberd.Analysis) -> None:
    n = int(found["targets"]["n"][0])
    values = found.map("x_mm", n)
    x_mm = found["targets"]["x_mm"][found["targets"]["n"] == n]
    assert np.array_equal(np.sort(values[np.isfinite(values)]), np.sort(x_mm[np.isfinite(x_mm)]))
    assert np.isfinite(values).any()
    with pytest.raises(InputError, match="field 9999 was not analysed"):
        found.map("x_mm", 9999)


def test_it_is_drawn(found: grabberd.Analysis) -> None:
    figure = pytest.importorskip("matplotlib.figure").Figure()
    axes = figure.subplots(2)
    found.plot("area_mm2", axes[0])
    n = int(found["targets"]["n"][0])
    assert found.plot_map("z_mm", n, axes[1]).get_title() == f"z_mm, field {n}"


def test_it_is_saved_with_its_report(found: grabberd.Analysis, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    files = found.save(tmp_path / "out")
    assert {"report.html", "fields.csv"} <= {one.name for one in files}
    with pytest.raises(InputError, match="xls"):
        found.save(tmp_path / "more", ["xls"])
