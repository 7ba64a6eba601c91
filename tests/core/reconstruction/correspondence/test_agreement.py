from dataclasses import fields, replace

import numpy as np
import pytest

from core.reconstruction.liners import COLUMNS, model, wall
from grabberd.core.reconstruction import CorrespondenceSettings
from grabberd.core.reconstruction.correspondence.agreement import Agreement, Hypotheses

MODEL = model()
JUDGE = Agreement(MODEL, CorrespondenceSettings())


def true_ones(deflection_mm=4.0, targets=tuple(range(108))) -> Hypotheses:
    """One right hypothesis for each target, with blobs numbered like targets."""
    target = np.array(targets, np.intp)
    displacement = (wall(deflection_mm)[0] - MODEL.xyz_mm)[target]
    return Hypotheses(target, target, target, displacement, np.full((len(target), 3), 0.01))


def joined(*parts: Hypotheses) -> Hypotheses:
    columns = [[getattr(part, column.name) for part in parts] for column in fields(Hypotheses)]
    together = Hypotheses(*map(np.concatenate, columns))
    return together.select(np.argsort(together.target, kind="stable"))


def wrong(target, off_mm, left=200, right=201) -> Hypotheses:
    true = true_ones(targets=[target])
    moved = true.displacement_mm + np.array(off_mm)
    return replace(true, left=np.array([left]), right=np.array([right]), displacement_mm=moved)


@pytest.mark.parametrize("deflection_mm", [0.0, 3.0, 6.0])
def test_hypotheses_that_are_right_all_agree(deflection_mm):
    assert JUDGE.largest(true_ones(deflection_mm)).tolist() == list(range(108))


def test_one_that_is_far_from_where_its_neighbours_are_is_left_out():
    known = joined(true_ones(targets=np.delete(np.arange(108), 40)), wrong(40, [0.0, 3.0, 4.0]))
    assert known.target[JUDGE.largest(known)].tolist() == np.delete(np.arange(108), 40).tolist()


def test_of_two_for_a_target_the_one_that_agrees_is_taken():
    known = joined(wrong(40, [0.0, 0.0, 4.0]), true_ones())
    chosen = JUDGE.largest(known)
    assert known.left[chosen].tolist() == list(range(108))


def test_where_two_agree_alike_the_target_stays_unidentified():
    known = joined(true_ones(), wrong(40, [0.0, 0.0, 0.05]))
    assert known.target[JUDGE.largest(known)].tolist() == np.delete(np.arange(108), 40).tolist()


def test_a_blob_is_used_once():
    stolen = wrong(41, [0.1, 0.0, 0.1], left=40, right=240)
    known = joined(true_ones(targets=np.delete(np.arange(108), 41)), stolen)
    chosen = known.select(JUDGE.largest(known))
    assert len(set(chosen.left.tolist())) == len(chosen)


def test_a_grid_shifted_by_a_column_loses_against_the_grid_in_its_place():
    apart = MODEL.xyz_mm[1:] - MODEL.xyz_mm[:-1]
    inner = np.flatnonzero(MODEL.column < COLUMNS - 1)
    true = true_ones(0.5)
    shifted = Hypotheses(
        inner,
        inner + 1,
        inner + 1,
        true.displacement_mm[inner + 1] + apart[inner],
        np.full((len(inner), 3), 0.01),
    )
    known = joined(shifted, true)
    chosen = known.select(JUDGE.largest(known))
    assert (chosen.left == chosen.target).all()
    assert len(chosen) == 108


def test_nothing_agrees_with_nothing():
    assert len(JUDGE.largest(true_ones(targets=[]))) == 0
    assert len(JUDGE.largest(true_ones(targets=[3, 90]))) == 0


def test_among_chosen_ones_the_worst_is_dropped_and_its_neighbours_are_kept():
    known = joined(
        true_ones(targets=np.delete(np.arange(108), [40, 70])), wrong(40, [0, 0, 3]), wrong(70, [0, 2, 0])
    )
    stay, expected = JUDGE.consistent(known, np.arange(108))
    assert known.target[stay].tolist() == np.delete(np.arange(108), [40, 70]).tolist()
    truth = wall(4.0)[0] - MODEL.xyz_mm
    assert np.abs(expected.displacement_mm - truth)[[40, 70]].max() < 0.2


def test_neighbours_that_are_torn_apart_are_not_both_kept():
    loose = Agreement(MODEL, CorrespondenceSettings(gate=1e3))
    known = joined(true_ones(targets=np.delete(np.arange(108), 40)), wrong(40, [3.5, 0, 0]))
    stay, _ = loose.consistent(known, np.arange(108))
    assert 40 not in known.target[stay]
    assert len(stay) == 107
