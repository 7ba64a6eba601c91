"""What is wrong with the inputs of an analysis, said before it begins."""

from typing import Any

import pytest

from archive.milkings import object_document
from core.chain.milking import MATERIAL
from grabberd.core.reconstruction import ObjectModel
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.chain.analysis.profile_inputs import check_inputs

CONSTANT = {"kpa": 42.0, "sigma_kpa": 0.3}
WAVE = {"rate_per_min": 60, "ratio": 0.6, "system_kpa": 42, "sigma_kpa": 0.3, "a_s": 0.1, "c_s": 0.1}


@pytest.fixture(scope="module")
def grid() -> Grid:
    return Grid.of(ObjectModel.from_document(object_document()))


def found(grid: Grid, *recorded: str, **inputs: Any) -> list[str]:
    return check_inputs(inputs, grid, {name: (name,) for name in recorded})


def test_nothing_is_wrong_with_inputs_that_an_analysis_takes(grid: Grid) -> None:
    vacuum = {"pulsation": WAVE, "liner": CONSTANT, "offset": {"s": 1.0, "sigma_s": 0.01}}
    assert found(grid, material=dict(MATERIAL), vacuum=vacuum, reference="nominal", plane="symmetry") == []
    recorded = {"pulsation": "channel", "liner": "channel"}
    assert found(grid, "pulsation", "liner", vacuum=recorded) == []


def test_a_channel_has_to_be_named_where_several_could_be_meant(grid: Grid) -> None:
    two = {"pulsation": ("front", "rear")}
    (said,) = check_inputs({"vacuum": {"pulsation": "channel"}}, grid, two)
    assert "front and rear" in said
    assert check_inputs({"vacuum": {"pulsation": {"channel": "rear"}}}, grid, two) == []
    (said,) = check_inputs({"vacuum": {"pulsation": {"channel": "left"}}}, grid, two)
    assert "channel left" in said


def test_all_of_it_is_said_at_once(grid: Grid) -> None:
    wrong = {**MATERIAL, "poisson": "rubber"}
    vacuum = {"pulsation": {**WAVE, "ratio": None}, "liner": {"kpa": 42.0}}
    problems = "\n".join(found(grid, material=wrong, vacuum=vacuum, phases=1, unknown=3))
    for part in ("poisson", "ratio", "sigma_kpa", "phases", "unknown"):
        assert part in problems


@pytest.mark.parametrize(
    ("vacuum", "words"),
    [
        ({"liner": "channel"}, "the capture's own channel, and it has none"),
        ({"liner": "log"}, "a logger's file, and there is none"),
        ({"liner": "log", "log": "time_s,liner_vacuum_kpa\n0,42\n1,42\n"}, "neither offset nor lag"),
        ({"liner": 42}, "is 42, expected"),
        ({"lag": {"opening_s": 0.1}}, "closing_s"),
        ({"offset": {"s": 1.0}}, "sigma_s"),
    ],
)
def test_a_vacuum_that_cannot_be_used_is_named(grid: Grid, vacuum: dict[str, Any], words: str) -> None:
    assert words in "\n".join(found(grid, vacuum=vacuum))
