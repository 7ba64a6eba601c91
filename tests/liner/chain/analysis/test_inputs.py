"""The inputs of an analysis: all optional, nothing assumed, every mistake named."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from core.chain.milking import MATERIAL, grid, inputs
from grabberd.errors import InputError
from grabberd_liner.analysis.grid import NominalShape
from grabberd_liner.chain.analysis.inputs import SOUGHT_KPA


def refusal(**document):
    with pytest.raises(InputError) as caught:
        inputs(**document)
    return caught.value.message


def test_nothing_is_needed_and_nothing_of_the_liner_is_assumed() -> None:
    read = inputs()
    assert (read.reference, read.zones, read.plane, read.sought_kpa) == (None, (), None, SOUGHT_KPA)
    assert read.assumed == {}
    assert read.unseen == "free"
    assert len(read.lacks) == 6


def test_nothing_lacks_when_all_is_given() -> None:
    vacuum = {"pulsation": {"kpa": 0, "sigma_kpa": 0.5}, "liner": {"kpa": 42, "sigma_kpa": 0.5}}
    read = inputs(
        reference="nominal",
        material={**MATERIAL, "first_end_mm": -65, "last_end_mm": 65},
        vacuum=vacuum,
        plane="symmetry",
        sought_kpa=1,
        flow_stop={"kpa": 9, "sigma_kpa": 1},
        heights_mm=[5, -5],
    )
    assert read.lacks == ()
    assert read.assumed == {}
    assert read.heights_mm == (-5.0, 5.0)


def test_what_the_equilibrium_does_not_use_need_not_be_given_and_each_default_is_said() -> None:
    given = {key: value for key, value in MATERIAL.items() if key not in ("law", "poisson", "radius_mm")}
    read = inputs(material=given)
    material = read.zones[0].material
    assert (material.law, material.poisson) == ("neo_hookean", 0.5)
    assert material.radius_mm + material.depth_mm == pytest.approx(NominalShape.of(grid()).radius_mm)
    assert set(read.assumed) == {"material.law", "material.poisson", "material.radius_mm", "sought_kpa"}
    assert read.assumed["material.radius_mm"].endswith("from the object model")


def test_without_heights_the_middle_half_of_the_liner_has_three() -> None:
    x_mm = grid().nominal_mm[:, 0]
    low, middle, high = inputs().heights_mm
    assert_allclose([low, middle, high], [-high, 0, -low], atol=1e-9)
    assert 0.5 <= np.mean((x_mm >= low) & (x_mm <= high)) < 0.8


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("nominal", "the object model's nominal shape"),
        ({"field": 12}, "field 12"),
        ({"phase": 0.4}, "phase 0.4 of the mean cycle"),
    ],
)
def test_a_reference_state_says_what_it_is(value: object, said: str) -> None:
    assert str(inputs(reference=value).reference) == said


@pytest.mark.parametrize(
    ("document", "named"),
    [
        ({"referenc": "nominal"}, "referenc"),
        ({"reference": "open"}, "reference"),
        ({"reference": {"field": -1}}, "reference.field"),
        ({"reference": {"field": 1, "phase": 0.1}}, "reference"),
        ({"reference": {"phase": 1.5}}, "reference.phase"),
        ({"vacuum": 42}, "vacuum"),
        ({"vacuum": {"pulsator": {}}}, "pulsator"),
        ({"vacuum": {"offset": {}, "lag": {}}}, "offset and lag"),
        ({"plane": "middle"}, "plane"),
        ({"plane": {"point_mm": [0, 0, 0], "normal": [0, 0, 0]}}, "plane.normal"),
        ({"plane": {"point_mm": [0, 0], "normal": [0, 0, 1]}}, "plane.point_mm"),
        ({"heights_mm": "low"}, "heights_mm"),
        ({"phases": 1}, "phases"),
        ({"phases": 5000}, "phases"),
        ({"sought_kpa": 0}, "sought_kpa"),
        ({"unseen": "guessed"}, "unseen"),
        ({"free_rows": [3, 9]}, "free_rows"),
        ({"material": "rubber"}, "material"),
    ],
)
def test_a_mistake_is_named(document: dict[str, object], named: str) -> None:
    assert named in refusal(**document)


def test_all_mistakes_are_named_at_once() -> None:
    message = refusal(reference="open", phases=0, colour="red")
    assert all(key in message for key in ("reference", "phases", "colour"))


@pytest.mark.parametrize("wall_mm", [0, -2.5, float("nan"), 30])
def test_a_wall_of_no_thickness_or_more_than_the_liner_has_is_refused(wall_mm: float) -> None:
    assert "wall_mm" in refusal(material={**MATERIAL, "wall_mm": wall_mm})


@pytest.mark.parametrize("key", ["E_mpa", "wall_mm", "F0_n", "target_mm"])
def test_a_material_that_lacks_what_no_default_can_stand_for_is_refused(key: str) -> None:
    assert key in refusal(material={name: value for name, value in MATERIAL.items() if name != key})


def test_fields_of_a_still_wall_may_be_averaged() -> None:
    assert inputs().average == 1
    assert inputs(average=10).average == 10
    assert "average" in refusal(average=0)


def test_another_capture_may_be_the_reference_state() -> None:
    reference = inputs(reference={"capture": "c1"}).reference
    assert reference is not None
    assert (reference.kind, reference.capture, str(reference)) == ("capture", "c1", "capture c1")
    assert "reference.capture" in refusal(reference={"capture": 1})
