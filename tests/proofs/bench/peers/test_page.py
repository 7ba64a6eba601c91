"""The page of all runs is what their documents make."""

import copy

import pytest

from .history import PAGE, RUNS, kept
from .rendering import page


def located(by, way, picture, x_px, found):
    errors = {"x_px": x_px, "y_px": x_px + 0.1}
    return {"by": by, "way": way, "picture": picture, **errors, "found": found, "of": 10, "wrong": 10 - found}


RUN = {
    "schema": "grabberd/benchmark/1",
    "at_utc": "2030-02-03T04:05:06Z",
    "commit": "abc1234",
    "machine": {"cpu": "A processor", "cores": 2, "system": "Linux x86_64"},
    "versions": {"ours": {"Python": "3.11.7"}, "peers": {"optv": "0.3.2"}},
    "fields": 40,
    "turns": 21,
    "located": [
        located("ours", "1 bit, doubled", "1 bit, doubled", 0.1, 9) | {"goal": [0.1, 0.1]},
        located("peer", "scipy, 288", "1 bit, 288", 0.3, 8),
        located("peer", "trackpy", "8 bit, 288", 0.5, 7),
    ],
    "points": [
        {"by": "peer", "way": "optv", "picture": "8 bit, 288", "right": 5, "of": 6, "wrong": 1}
        | {"x_mm": 0.01, "y_mm": 0.02, "z_mm": 0.03, "xyz_mm": 0.04}
    ],
    "optv_disagreement_px": 0.0045,
    "compared": [
        {"group": "Both", "ours": "1 bit, 288", "peer": "cv2 fastest, 288", "goal": 0.5}
        | {"ours_us": 200.0, "peer_us": 400.0, "ratio": 0.5, "low": 0.4, "high": 0.6},
        {"group": "Both", "ours": "8 bit, 288", "peer": "trackpy", "goal": None}
        | {"ours_us": 1000.0, "peer_us": 500.0, "ratio": 2.0, "low": 1.5, "high": 2.5},
    ],
    "load": {"before": [0.1, 0.2, 0.3], "after": [1.0, 0.5, 0.3]},
    "took_s": 200,
}


def of(at_utc, ratio=0.5):
    run = copy.deepcopy(RUN) | {"at_utc": at_utc}
    run["compared"][0]["ratio"] = ratio
    return run


def test_the_page_in_docs_is_made_from_the_runs_beside_it():
    assert PAGE.read_text() == page(kept(RUNS)), "run `make bench`"


def test_a_row_has_both_times_how_much_faster_than_real_time_the_ratio_its_spread_and_the_goal():
    row = "| 1 bit, 288 | 200 | 100 × | {} | 400 | **0.5** | 0.4 … 0.6 | ≤ 0.5: reached |"
    assert row.format("cv2…WithAlgorithm, 16-bit labels, Bolelli") in page([RUN])


def test_a_goal_that_is_not_reached_is_said_so():
    assert "≤ 0.5: not reached" in page([of(RUN["at_utc"], 0.51)])


@pytest.mark.parametrize(
    "row",
    [
        "| grabberd | 1 bit, doubled | 0.100 | 0.200 | 9 of 10 | 1 | ≤ 0.1 / 0.1: not reached |",
        "| scipy.ndimage.label, center_of_mass | 1 bit, 288 lines | 0.300 | 0.400 | 8 of 10 | 2 |  |",
        "| trackpy.locate, numba | 8 bit, 288 lines | 0.500 | 0.600 | 7 of 10 | 3 |  |",
        "| 8 bit, 288 lines | 0.010 | 0.020 | 0.030 | 0.040 | 5 of 6 | 1 |  |",
    ],
)
def test_accuracy_stands_beside_speed(row):
    assert row in page([RUN])


def test_the_machine_its_load_the_commit_and_the_versions_are_named():
    text = page([RUN])
    for word in ("A processor", "2 cores", "load 0.10 before, 1.00 after", "abc1234", "optv 0.3.2"):
        assert word in text


def test_the_newest_run_is_whole_and_each_earlier_one_is_a_line_newest_first():
    text = page(
        [of("2030-01-01T00:00:00Z", 0.71), of("2030-03-01T00:00:00Z"), of("2030-02-01T00:00:00Z", 0.62)]
    )
    whole, lines = text.split("## Earlier runs")
    assert "## 2030-03-01 00:00 UTC" in whole
    assert lines.index("2030-02-01 00:00 UTC | abc1234 | A processor | 0.1 | 0.62 |") < lines.index(
        "| 0.71 |"
    )
    assert "trackpy" not in lines


def test_what_an_earlier_run_did_not_compare_is_a_dash():
    earlier = of("2030-01-01T00:00:00Z")
    del earlier["compared"][0]
    assert page([RUN, earlier]).splitlines()[-1].endswith("| – |")


def test_without_runs_there_is_only_the_explanation():
    assert "##" not in page([])


@pytest.mark.parametrize(
    ("right", "wrong", "words"),
    [
        (99, 0, "≥ 99%, none wrong: reached"),
        (98, 0, "≥ 99%, none wrong: not reached"),
        (99, 1, "≥ 99%, none wrong: not reached"),
    ],
)
def test_correspondences_are_good_when_nearly_all_are_right_and_none_is_wrong(right, wrong, words):
    run = copy.deepcopy(RUN)
    run["points"][0] |= {"goal": 0.99, "right": right, "of": 100, "wrong": wrong}
    assert f"{words} |" in page([run])
