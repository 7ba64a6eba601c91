"""What the profile of a field's way says can be believed."""

import pytest

from .hot_path import STAGES, functions, stages_us, table, watched
from .peers.given import given


@pytest.fixture(scope="module")
def scene():
    return given(3)


def test_the_stages_and_the_rest_are_the_whole(scene):
    taken = stages_us(scene.packed["1 bit, 288"], scene.setup)
    assert all(taken[name] > 0 for name in STAGES)
    assert sum(taken[name] for name in [*STAGES, "the rest"]) == pytest.approx(taken["all"])


def test_what_was_watched_is_as_it_was_afterwards():
    before = [getattr(*where) for where in STAGES.values()]
    with watched():
        assert [getattr(*where) for where in STAGES.values()] != before
    assert [getattr(*where) for where in STAGES.values()] == before


def test_the_table_has_a_column_for_each_stage_and_one_for_what_lies_between():
    took = dict.fromkeys(STAGES, 10.0) | {"the rest": 2.0, "all": 32.0}
    assert table({"1 bit, 288": took}).splitlines()[-1] == f"| 1 bit, 288{' | 10' * len(STAGES)} | 2 | 32 |"


def test_the_functions_listed_are_those_that_measure_a_field(scene):
    assert "measure.py" in functions(scene.packed["8 bit, 288"], scene.setup, 40)
