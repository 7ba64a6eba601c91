"""A ramp with the empty liner, as an analysis: its values, its collapse, and the other captures' material."""

import json
from dataclasses import replace

import numpy as np
import pytest

from grabberd.errors import InputError
from grabberd_fake.wall_states import buckling_kpa, touch_kpa
from grabberd_liner.analysis.pulsation.movement import TimedPoints
from grabberd_liner.analysis.wall.material import read_zones
from grabberd_liner.chain.analysis.analyse import analyse
from grabberd_liner.chain.analysis.inputs import read_inputs
from grabberd_liner.chain.analysis.quantities import quantities
from grabberd_liner.chain.analysis.tables import tables
from grabberd_liner.chain.analysis.wall_state import FieldPoints
from liner.analysis.ramps import BROAD, empty

LINER_KPA, RATE_KPA_PER_S = 42.0, 1.0


def material():
    design = empty("thin").design
    return {
        "law": "neo_hookean",
        "E_mpa": design["young_mpa"] * 1.1,
        "wall_mm": design["wall_mm"],
        "F0_n": design["pretension_n"],
        "E_sigma_mpa": design["young_mpa"] * BROAD["E_mpa"],
        "wall_sigma_mm": design["wall_mm"] * BROAD["wall_mm"],
        "F0_sigma_n": design["pretension_n"] * BROAD["F0_n"],
        "poisson": 0.5,
        "radius_mm": design["radius_mm"],
        "target_mm": 0.0,
        "first_end_mm": -65.0,
        "last_end_mm": 65.0,
    }


def inputs(**changed):
    duration_s = 1.1 * touch_kpa(empty("thin").states) / RATE_KPA_PER_S
    log = "time_s,pulsation_vacuum_kpa\n" + "\n".join(
        f"{time_s:.3f},{LINER_KPA - max(time_s, 0.0) * RATE_KPA_PER_S:.3f}"
        for time_s in np.arange(-1.0, duration_s + 1.0, 0.01)
    )
    vacuum = {
        "pulsation": "log",
        "liner": {"kpa": LINER_KPA, "sigma_kpa": 0.05},
        "log": log,
        "offset": {"s": 0.0, "sigma_s": 0.001},
        "gauge_sigma_kpa": 0.05,
    }
    return {"teat": "none", "reference": {"field": 0}, "material": material(), "vacuum": vacuum} | changed


def fields():
    """A ramp from an open liner to one whose walls have just touched."""
    liner = empty("thin")
    kpa = np.concatenate([np.linspace(0.0, 5.4, 8), np.linspace(5.6, 8.4, 36)])
    return [FieldPoints(n, TimedPoints(at / RATE_KPA_PER_S, liner.points(at, n))) for n, at in enumerate(kpa)]


@pytest.fixture(scope="module")
def analysed():
    grid = empty("thin").grid
    return analyse([fields()], grid, read_inputs(inputs(), grid))


@pytest.fixture(scope="module")
def row(analysed):
    """The row of the table."""
    ramp = tables(analysed)["ramp"]
    return {column.name: ramp.column(column.name)[0] for column in ramp.columns}


def test_a_ramp_gives_the_liner_s_stiffness_with_its_sigma(row):
    design = empty("thin").design
    true = design["young_mpa"] * design["wall_mm"] ** 3 / 9
    assert row["stiffness_n_mm"] == pytest.approx(true, rel=0.05)
    assert 0 < row["sigma_stiffness_n_mm"] < 0.05 * true


def test_the_liner_s_own_values_are_the_same_numbers_among_the_quantities(analysed, row):
    found = {one.quantity.name: one for one in quantities(analysed)}
    for name in ("touch_kpa", "buckling_kpa", "stiffness_n_mm", "E_mpa", "wall_mm", "F0_n"):
        assert (found[name].value, found[name].sigma) == (row[name], row[f"sigma_{name}"])
        assert 0 < found[name].common <= found[name].sigma
    assert "ramp with the empty liner" in found["stroke_mm"].reason


def test_what_a_ramp_does_not_tell_has_its_reason(analysed):
    broken = analysed.empty._replace(values=None, collapse=None, reasons=("it does not buckle", "no touch"))
    found = {one.quantity.name: one for one in quantities(replace(analysed, empty=broken))}
    assert found["E_mpa"].reason == "it does not buckle"
    assert found["touch_kpa"].reason == "no touch"


def test_a_ramp_gives_touch_and_buckling(row):
    states = empty("thin").states
    assert row["touch_kpa"] == pytest.approx(touch_kpa(states), abs=0.25)
    assert row["buckling_kpa"] == pytest.approx(buckling_kpa(states), abs=0.25)


def test_the_material_is_ready_to_be_given_to_the_other_captures(analysed, row):
    (zone,) = read_zones(json.loads(row["material"]), analysed.grid)
    assert zone.material.E_mpa == pytest.approx(row["E_mpa"], rel=1e-4)
    assert zone.material.correlations[0] < 0


def test_a_ramp_has_no_pressure_on_a_teat_and_lacks_none(analysed):
    assert all(state.pressure is None for state in analysed.states)
    assert not any("pressure" in one for one in analysed.inputs.lacks)


def test_a_capture_with_a_teat_has_no_row():
    grid = empty("thin").grid
    given = inputs()
    del given["teat"]
    found = analyse([fields()[:3]], grid, read_inputs(given | {"vacuum": {}}, grid))
    assert len(tables(found)["ramp"].column("E_mpa")) == 0


def test_a_ramp_asks_for_the_sigma_of_a_logger_s_zero():
    grid = empty("thin").grid
    given = inputs()
    del given["vacuum"]["gauge_sigma_kpa"]
    with pytest.raises(InputError, match=r"lack vacuum\.gauge_sigma_kpa"):
        analyse([fields()[:3]], grid, read_inputs(given, grid))


def test_a_teat_that_is_anything_else_is_refused():
    with pytest.raises(InputError, match="teat"):
        read_inputs({"teat": "round"}, empty("thin").grid)


def test_what_a_ramp_does_not_determine_is_among_the_problems():
    grid = empty("thin").grid
    found = analyse([fields()[:20]], grid, read_inputs(inputs(), grid))
    assert any("touch" in one for one in found.problems)
