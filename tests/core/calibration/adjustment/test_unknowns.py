import numpy as np
import pytest

from core.calibration.networks import TRUE, rough
from grabberd.core.calibration.adjustment.network import LENS, Unknowns
from grabberd.core.geometry import PARAMETERS
from grabberd.errors import InputError


def test_all_parameters_of_two_views_are_36_unknowns_and_34_with_b9_tied():
    assert len(Unknowns.of(TRUE)) == 36
    assert len(Unknowns.of(TRUE, tied=True)) == 34
    assert len(Unknowns.of(TRUE, tied=True, shared=LENS)) == 26


def test_unknowns_are_named_after_their_view_or_the_lens():
    names = Unknowns.of(TRUE, ("f_mm", "b1", "right.b2"), shared=("f_mm",)).names
    assert names == ("lens.f_mm", "left.b1", "right.b1", "right.b2")


def test_dropped_unknowns_are_held_and_the_rest_keep_their_order():
    unknowns = Unknowns.of(TRUE, ("f_mm", "b1", "b2"))
    fewer = unknowns.without(["left.b1", "right.f_mm"])
    assert fewer.names == ("left.f_mm", "left.b2", "right.b1", "right.b2")
    assert fewer.number[0, PARAMETERS.index("b1")] == -1
    assert fewer.number[1, PARAMETERS.index("b2")] == 3


def test_a_step_moves_what_is_sought_and_nothing_else():
    unknowns = Unknowns.of(TRUE, ("f_mm", "b8", "b9"), tied=True)
    left, right = unknowns.moved(TRUE, np.array([0.1, 0.2, 0.3, 0.4]))
    assert left.f_mm == pytest.approx(8.1)
    assert right.b[7] - TRUE[1].b[7] == right.b[8] - TRUE[1].b[8] == pytest.approx(0.4)
    assert left.Z0_mm == TRUE[0].Z0_mm


def test_values_put_in_come_out_again_and_shared_ones_are_a_mean():
    views = rough()
    unknowns = Unknowns.of(views, shared=LENS)
    values = unknowns.values(views)
    assert values[0] == pytest.approx(np.mean([view.f_mm for view in views]))
    assert np.allclose(unknowns.values(unknowns.with_values(views, values)), values, rtol=1e-15)


def test_the_selection_carries_unknowns_to_parameters():
    unknowns = Unknowns.of(TRUE, ("f_mm", "left.b1"), shared=("f_mm",))
    changes = unknowns.selection @ np.array([1.0, 2.0])
    assert np.flatnonzero(changes).tolist() == [0, 9, 18]
    assert changes[[0, 9, 18]].tolist() == [1.0, 2.0, 1.0]


@pytest.mark.parametrize("free", [("b10",), ("middle.b1",), ("left.f",)])
def test_a_name_that_does_not_exist_is_refused(free):
    with pytest.raises(InputError, match=free[0]):
        Unknowns.of(TRUE, free)


def test_sharing_what_is_not_sought_in_all_views_is_refused():
    with pytest.raises(InputError, match="f_mm cannot be shared"):
        Unknowns.of(TRUE, ("left.f_mm",), shared=("f_mm",))
