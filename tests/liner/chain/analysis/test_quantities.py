"""The field's own quantities in an analysis: rows with σ, or with the reason why they are missing."""

from dataclasses import replace

import numpy as np
import pytest

from core.chain.milking import CLOSED_S, CONSTANT, FAKE, OPEN_S, analysed, field, grid, inputs, log, still
from grabberd.errors import InputError
from grabberd_fake.vacuum import pulsation_kpa
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.load.pressure import PressureMap
from grabberd_liner.analysis.vacuum.milk_flow import FlowCurve
from grabberd_liner.analysis.vacuum.vacuum import ChannelCurve
from grabberd_liner.chain.analysis.analysis_document import analysis_document
from grabberd_liner.chain.analysis.columns import TABLES
from grabberd_liner.chain.analysis.inputs import read_inputs
from grabberd_liner.chain.analysis.quantities import quantities
from grabberd_liner.chain.analysis.tables import QUANTITY_COLUMNS, tables
from liner.analysis.load.profiles import TEAT_END_MM, X_MM, closed

FIELDS = [field(n) for n in range(62)]
LOGGED = {
    "pulsation": "log",
    "liner": "log",
    "log": log(1.6, start_s=-0.3),
    "offset": {"s": -0.3, "sigma_s": 0.001},
}
LAGS = {"opening_lag_s", "closing_lag_s"}
OF_MILK_FLOW = {
    "flow_duration_s",
    *(f"{what}_{way}_kpa" for what in ("flow_stop", "overpressure") for way in ("derived", "raised")),
}
OF_THE_MAP = {"flow_stop_map_kpa", "overpressure_map_kpa"}
BOTH = "overpressure_disagreement_kpa"
OF_A_RAMP = {"touch_kpa", "buckling_kpa", "stiffness_n_mm", "E_mpa", "wall_mm", "F0_n"}


@pytest.fixture(scope="module")
def plain():
    """Without material, so without pressure."""
    return analysed(FIELDS, reference="nominal", vacuum=LOGGED, phases=12, sought_kpa=1.0)


@pytest.fixture(scope="module")
def loaded(plain):
    """The same with a load that is as if there were a teat."""
    none = Estimate(np.zeros(35), np.ones(35))
    mean, seen = Estimate(np.zeros(()), np.ones(())), np.ones(35, bool)
    pressure = PressureMap(none, mean, none, 0.7, None, seen, ("",) * 35, closed())
    phases = tuple(state._replace(pressure=pressure) for state in plain.phases)
    given = replace(plain.inputs, flow_stop_kpa=Estimate(np.asarray(9.0), np.asarray(1.0)))
    return replace(plain, phases=phases, inputs=given)


def true_stroke_mm():
    """Of the target that moves most."""
    ends = [field(0, time_s, sigma_mm=np.full(3, 1e-9)).timed.points.xyz_mm for time_s in (OPEN_S, CLOSED_S)]
    return np.linalg.norm(ends[0] - ends[1], axis=1).max()


def by_name(analysis):
    return {one.quantity.name: one for one in quantities(analysis)}


def test_with_a_load_every_quantity_of_a_milking_has_a_value_and_sigma(loaded):
    found = by_name(loaded)
    for name in found.keys() - LAGS - OF_A_RAMP - OF_MILK_FLOW - OF_THE_MAP - {BOTH}:
        one = found[name]
        assert np.isfinite(one.value), one
        assert one.sigma > 0, one
        assert 0 <= one.common <= one.sigma, one
        assert not one.reason
    assert {found[name].reason for name in OF_A_RAMP} == {"the capture is no ramp with the empty liner"}
    assert all("no clock" in found[name].reason for name in LAGS)


def test_a_quantity_is_the_same_number_in_every_table(loaded):
    made = tables(loaded)
    summary, rows = made["summary"], made["quantities"]
    number = dict(zip(rows.column("name"), rows.column("value"), strict=True))
    sigma = dict(zip(rows.column("name"), rows.column("sigma_value"), strict=True))
    assert {"stroke_mm", "rate_per_min", "wall_ratio", "iso_ratio", "wall_d_s", "iso_d_s"} <= set(
        QUANTITY_COLUMNS
    )
    for column, name in QUANTITY_COLUMNS.items():
        assert summary.column(column) == pytest.approx(number[name], rel=0, abs=0, nan_ok=True)
        assert summary.column(f"sigma_{column}") == pytest.approx(sigma[name], rel=0, abs=0, nan_ok=True)


def test_the_stroke_is_that_of_the_mean_cycle_and_not_of_noisy_fields(loaded):
    found, moved = by_name(loaded)["stroke_mm"], loaded.movement.value_mm
    assert found.value < np.ptp(moved)
    assert found.value == pytest.approx(true_stroke_mm(), abs=3 * found.sigma)


def test_massage_and_liner_times_are_those_of_the_wall_phases(loaded):
    found, wall = by_name(loaded), loaded.cycle.wall.durations_s
    for name, phase in (("liner_opening_s", 0), ("liner_closing_s", 2), ("massage_time_s", 3)):
        assert found[name].value == wall.value[phase]
        assert found[name].sigma == wall.sigma[phase]


def test_the_logged_vacuum_has_verdicts(loaded):
    found = by_name(loaded)
    assert {found[name].verdict for name in ("phase_b_share", "phase_d_share", "phase_d_s")} <= {
        "met",
        "not met",
    }


def test_without_material_the_rows_say_what_lacks(plain):
    found = by_name(plain)
    assert found["teat_load_n"].reason == "there is no pressure without material"
    assert found["massage_time_s"].value > 0


def test_a_constant_vacuum_has_no_verdict():
    found = by_name(analysed(FIELDS, vacuum=CONSTANT, phases=4))
    assert "not known as a curve" in found["phase_d_s"].reason


def test_a_wall_that_rests_has_no_quantities_and_says_so():
    found = by_name(analysed(still(6)))
    assert {one.reason for one in found.values()} == {
        "there is no mean cycle",
        "the pulsation chamber's vacuum is not known as a curve: its phases have no durations",
        "the vacuum has no clock that a light, or the capture itself, relates to the camera's",
        "the capture is no ramp with the empty liner",
        "the vacuum on both sides of the wall is not known",
        "flow_stop was not given: the contact pressure at the teat's end at which milk just stops flowing",
        "only one way to the overpressure, or none, has a result",
    }


@pytest.fixture(scope="module")
def milking():
    """Three cycles with a log and without material."""
    given = LOGGED | {"log": log(2.6, start_s=-0.3)}
    return analysed([field(n) for n in range(112)], reference="nominal", vacuum=given, phases=4)


def test_milk_flow_gives_the_derived_overpressure(milking):
    time_s = np.arange(-0.25, 2.25, 1e-3)
    difference_kpa = FAKE.ellipse.wave.liner_kpa - pulsation_kpa(FAKE.ellipse, time_s)
    level = np.clip((34.0 - difference_kpa) / 2.0 + 0.5, 0.0, 1.0)
    found = by_name(replace(milking, inputs=replace(milking.inputs, milk_flow=FlowCurve(time_s, level))))
    assert found["flow_stop_derived_kpa"].value == pytest.approx(34.0, abs=0.1)
    assert found["overpressure_derived_kpa"].value == pytest.approx(8.0, abs=0.1)
    assert found["overpressure_derived_kpa"].sigma < 0.2
    assert "pulsates instead of being raised" in found["overpressure_raised_kpa"].reason
    assert found[BOTH].reason == "only one way to the overpressure, or none, has a result"


def test_what_a_way_lacks_is_said(milking):
    found = by_name(milking)
    assert {found[name].reason.partition(":")[0] for name in OF_MILK_FLOW} == {"milk_flow was not given"}
    assert {found[name].reason.partition(":")[0] for name in OF_THE_MAP} == {"flow_stop was not given"}


def test_the_map_s_overpressure_needs_states_that_are_pressed_differently(loaded):
    """All phases have the same load here, so none is below the occlusion pressure."""
    assert "never passes the 9 kPa of flow_stop" in by_name(loaded)["overpressure_map_kpa"].reason


def test_compression_is_also_given_above_atmosphere(loaded):
    found, liner_kpa = by_name(loaded), FAKE.ellipse.wave.liner_kpa
    for name in ("liner_compression_mean", "liner_compression_teat_end"):
        above = found[f"{name}_above_atmosphere_kpa"]
        assert above.value == pytest.approx(found[f"{name}_kpa"].value - liner_kpa, abs=0.1)
    table, first = tables(loaded)["phase_profile"], slice(len(X_MM))
    column = "compression_above_atmosphere_kpa"
    assert table.column(column)[first] == pytest.approx(
        table.column("compression_kpa")[first] - liner_kpa, abs=0.1
    )
    assert (table.column(f"sigma_{column}") >= table.column("sigma_compression_kpa")).all()


def test_the_wall_is_timed_by_a_millimetre_too(plain):
    found = by_name(plain)
    words = ("opening", "open", "closing", "closed")
    assert sum(found[f"liner_{word}_1mm_s"].value for word in words) == pytest.approx(0.6, abs=0.005)
    # A millimetre is more than a tenth of this stroke.
    assert found["stroke_mm"].value < 10
    assert found["liner_closing_1mm_s"].value < found["liner_closing_s"].value


def test_the_table_has_a_row_for_each_with_its_definition(loaded):
    table = tables(loaded)["quantities"]
    found = quantities(loaded)
    assert list(table.column("name")) == [one.quantity.name for one in found]
    for column, name in (("value", "value"), ("sigma_value", "sigma"), ("sigma_common", "common")):
        assert table.column(column) == pytest.approx([getattr(one, name) for one in found], nan_ok=True)
    assert all(text.endswith(".") for text in table.column("definition"))
    assert set(table.column("unit")) <= {"kPa", "mm", "N", "N/mm", "N mm", "MPa", "s", "1/min", "1"}


@pytest.mark.parametrize("name", ["quantities", "phase_profile", "profile"])
def test_the_tables_have_the_columns_and_types_of_their_specification(loaded, name):
    columns = tables(loaded)[name].columns
    assert [(one.name, one.dtype) for one in columns] == [
        (one.name, one.dtype) for one in TABLES[name].columns
    ]


def test_the_load_over_height_is_a_table_of_phases_and_heights(loaded):
    table, profile = tables(loaded)["phase_profile"], closed()
    assert len(table) == len(loaded.phase) * len(X_MM)
    first = table.column("phase") == loaded.phase[0]
    assert table.column("x_mm")[first] == pytest.approx(X_MM)
    assert table.column("load_n_per_mm")[first] == pytest.approx(profile.load_n_per_mm.value)
    assert table.column("sigma_compression_kpa")[first] == pytest.approx(1.0)
    assert table.column("gap_mm")[first][X_MM == TEAT_END_MM] > 1


def test_states_without_a_load_have_no_rows(plain):
    made = tables(plain)
    assert len(made["phase_profile"]) == 0
    assert len(made["profile"]) == 0


def test_the_document_holds_the_quantities_and_the_mean_cycle_s_load(loaded):
    document = analysis_document(loaded, tables(loaded), {})
    assert {"quantities", "phase_profile"} <= set(document["tables"])
    assert "profile" not in document["tables"]


def test_the_pressure_that_stops_the_flow_is_an_input():
    assert inputs(flow_stop={"kpa": 9, "sigma_kpa": 1}).flow_stop_kpa == (9, 1)
    assert inputs().flow_stop_kpa is None


@pytest.mark.parametrize(("flowing", "sense"), [("high", 1.0), ("low", -1.0)])
def test_the_reading_while_milk_flows_is_an_input(flowing, sense):
    readings = np.arange(20.0)
    channel = ChannelCurve("flow", readings / 200, readings, 0.0, 0.0, "a sensor")
    found = read_inputs({"milk_flow": flowing}, grid(), {"flow": channel}).milk_flow
    assert (found.level == sense * readings).all()


def test_milk_flow_without_a_channel_or_with_another_reading_is_refused():
    with pytest.raises(InputError, match="no readings of a channel flow"):
        inputs(milk_flow="high")
    with pytest.raises(InputError, match="milk_flow"):
        inputs(milk_flow="up")


@pytest.mark.parametrize(
    "value", [9, {"kpa": -1, "sigma_kpa": 1}, {"kpa": 9}, {"kpa": 9, "sigma_kpa": 1, "x": 2}]
)
def test_another_kind_of_flow_stop_is_refused(value):
    with pytest.raises(InputError, match="flow_stop"):
        inputs(flow_stop=value)
