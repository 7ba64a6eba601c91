from dataclasses import replace

import numpy as np
import pytest

from core.calibration.networks import LENS, TRUE, network, rough, tied
from grabberd.core.calibration.adjustment.adjustment import adjust
from grabberd.core.calibration.adjustment.network import LENS as SHARED
from grabberd.core.calibration.adjustment.network import Unknowns
from grabberd.core.calibration.significance import eliminate, f_tests
from grabberd.core.geometry import project


def views(*zero: int):
    """The true views, without these terms."""
    b = tuple(0.0 if index + 1 in zero else value for index, value in enumerate(LENS))
    return tuple(replace(view, b=b) for view in TRUE)


def by_name(tests, *parameters):
    return next(test for test in tests if test.parameters == parameters)


def test_terms_that_are_not_there_are_dropped_and_the_others_stay():
    lens = views(4, 5, 6, 7)
    found = eliminate(network(lens, start=rough(lens), seed=1), tied())
    gone = {name.split(".")[1] for name in found.dropped}
    assert {"b4", "b5", "b6", "b7"} & gone
    assert not {"b1", "b2", "b3", "b8=b9"} & gone
    assert all(test.p <= 0.05 for test in found.tests if test.round == found.tests[-1].round)
    assert set(found.adjustment.unknowns.names) == set(tied().names) - set(found.dropped)


def test_a_dropped_term_is_zero_and_not_what_it_started_with():
    lens = views(5)
    found = eliminate(network(lens, start=TRUE), tied())
    for name in found.dropped:
        side, term = name.split(".")
        view = next(view for view in found.adjustment.views if view.name == side)
        assert view.b[int(term[1]) - 1] == 0.0
    assert "left.b5" in found.dropped


def test_the_statistic_agrees_with_a_refit_without_the_terms():
    lens = views(1, 5, 6, 7)
    full = adjust(network(lens, start=lens), tied())
    for names in (("left.b5",), ("right.b6", "right.b7"), ("left.b1",)):
        test = by_name(f_tests(full), *names)
        values = full.values
        values[[full.unknowns.names.index(name) for name in names]] = 0.0
        start = full.unknowns.with_values(full.views, values)
        refit = adjust(full.network.starting_from(start), full.unknowns.without(names))
        more = refit.sum_of_squares - full.sum_of_squares
        statistic = more / len(names) / (full.sum_of_squares / full.freedom)
        assert test.statistic == pytest.approx(statistic, rel=2e-2)
        assert (test.q, test.freedom) == (len(names), full.freedom)


def test_insignificant_terms_are_found_significant_as_often_as_alpha_says():
    lens = views(6, 7)
    joint = [
        by_name(f_tests(adjust(network(lens, seed=seed), tied())), "left.b6", "left.b7").p
        for seed in range(60)
    ]
    assert 0.3 < np.mean(joint) < 0.7
    assert np.mean(np.array(joint) < 0.05) < 0.15


def test_radial_terms_go_from_the_top():
    lens = views(3, 4, 5)
    found = eliminate(network(lens, start=rough(lens), seed=1), tied())
    first = [test.parameters[0] for test in found.tests if test.kind == "nested" and test.round == 1]
    assert first == ["left.b5", "right.b5"]
    for side in ("left", "right"):
        order = [name for name in found.dropped if name in {f"{side}.b{i}" for i in (3, 4, 5)}]
        assert order == sorted(order, reverse=True)
        assert f"{side}.b5" in order


def test_one_group_goes_a_round_and_the_protocol_has_every_test():
    lens = views(4, 5, 6, 7)
    found = eliminate(network(lens), tied())
    rounds = max(test.round for test in found.tests)
    dropped = [test for test in found.tests if test.dropped]
    assert [test.round for test in dropped] == list(range(1, rounds))
    assert tuple(name for test in dropped for name in test.parameters) == found.dropped
    for test in dropped:
        assert test.p > 0.05
        rivals = [one for one in found.tests if one.round == test.round and one.kind == test.kind]
        assert test.p == max(one.p for one in rivals if one.p <= test.p)


def test_pairs_are_tested_jointly_and_singly():
    tests = f_tests(adjust(network(), Unknowns.of(TRUE)))
    kinds = {test.parameters: test.kind for test in tests}
    assert kinds["left.b6", "left.b7"] == kinds["right.b8", "right.b9"] == "joint"
    assert kinds["left.b8",] == "single"
    assert ("left.b3",) not in kinds


def test_only_distortion_is_tested_and_shared_terms_once():
    unknowns = Unknowns.of(TRUE, tied=True, shared=SHARED)
    names = {name for test in f_tests(adjust(network(), unknowns)) for name in test.parameters}
    assert names == {"lens.b5", "lens.b6", "lens.b7"} | {
        f"{side}.{term}" for side in ("left", "right") for term in ("b1", "b2", "b8=b9")
    }


def test_the_effect_is_the_greatest_shift_of_a_target_that_the_terms_make():
    full = adjust(network(), tied())
    test = by_name(f_tests(full), "left.b6", "left.b7")
    left = full.views[0]
    without = replace(left, b=(*left.b[:5], 0.0, 0.0, *left.b[7:]))
    moved = project(left, full.xyz_mm) - project(without, full.xyz_mm)
    assert test.effect_px == pytest.approx(np.hypot(*moved.T).max(), rel=1e-6)


def test_without_distortion_there_is_nothing_to_test():
    found = eliminate(network(), Unknowns.of(TRUE, ("f_mm", "kappa_rad")))
    assert found.tests == found.dropped == ()
