import numpy as np
from hypothesis import given

from geometry.rigs import aimed, views
from grabberd.geometry import PARAMETERS


@given(views())
def test_the_vector_of_a_view_gives_the_view_again(view):
    assert view.with_vector(view.vector()) == view


def test_the_vector_is_in_the_order_of_the_parameters():
    view = aimed("left")
    assert len(PARAMETERS) == 18
    assert [view.f_mm, view.Z0_mm, view.b[8]] == [
        view.vector()[PARAMETERS.index(n)] for n in ("f_mm", "Z0_mm", "b9")
    ]


def test_a_view_holds_the_pixels_of_its_half():
    edges = np.array([[-0.5, 0.0], [359.4, 575.0], [359.5, 0.0], [-0.6, 0.0]])
    assert aimed("left").holds(edges).tolist() == [True, True, False, False]
    assert aimed("right").holds(edges).tolist() == [False, False, True, False]
