"""What went wrong is said once, with the fields and phases that have it."""

import pytest

from grabberd.errors import AnalysisError
from grabberd_liner.chain.analysis.problems import Problems

LEFT_OUT = "left out, many σ from the prediction by the other points"


def noted(*pairs):
    problems = Problems(range(5))
    for state, words in pairs:
        problems.note(state, words)
    return problems.all()


def test_a_problem_of_several_fields_is_said_once():
    assert noted(("field 1", ["hole"]), ("field 2", []), ("field 3", ["hole"])) == ("field 1, field 3: hole",)


def test_many_fields_are_counted_after_the_tenth():
    (words,) = noted(*((f"field {n}", ["hole"]) for n in range(14)))
    assert words.endswith("field 9 and 4 more: hole")


def test_a_few_that_differ_in_their_targets_keep_a_line_each():
    lines = noted(*((f"field {n}", [f"{LEFT_OUT}: targets {n}, 60"]) for n in range(3)))
    assert len(lines) == 3
    assert lines[1] == f"field 1: {LEFT_OUT}: targets 1, 60"


def test_of_more_the_targets_are_counted_the_commonest_first():
    pairs = [(f"phase {n}", [f"{LEFT_OUT}: targets {n}, 60"]) for n in range(4)]
    (line,) = noted(*pairs, ("phase 4", [f"{LEFT_OUT}: targets 0, 60"]))
    states, _, targets = line.partition(f": {LEFT_OUT}: targets ")
    assert states == "phase 0, phase 1, phase 2, phase 3, phase 4"
    assert targets == "60 (5 times), 0 (2 times), 1, 2, 3"


def test_missing_fields_are_named_first():
    problems = Problems([0, 1, 4, 5])
    problems.note("field 1", ["hole"])
    missing, hole = problems.all()
    assert "2 fields are missing and were not filled in: 2 after field 1" in missing
    assert hole == "field 1: hole"


def test_what_the_data_do_not_determine_is_survived_and_the_rest_is_not():
    problems = Problems([0])

    def fails(error):
        raise error

    assert problems.survived(lambda: 3) == 3
    assert problems.survived(lambda: fails(AnalysisError("no cycle", "longer"))) is None
    assert (problems.latest, problems.all()) == ("no cycle", ("no cycle",))
    with pytest.raises(ZeroDivisionError):
        problems.survived(lambda: fails(ZeroDivisionError()))
