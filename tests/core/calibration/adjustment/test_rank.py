from dataclasses import replace

import numpy as np
import pytest

from core.calibration.networks import TRUE, frame, network, rough, tied
from grabberd.core.calibration.adjustment.adjustment import adjust
from grabberd.core.calibration.adjustment.network import LENS, Unknowns
from grabberd.core.calibration.adjustment.normal_equations import check_rank, null_vectors
from grabberd.core.geometry import PARAMETERS, parameter_derivatives
from grabberd.errors import MeasurementError, RankDeficient

PLANE = frame() * [1.0, 1.0, 0.0]


def null_vectors_of(jacobian, names):
    normal = jacobian.T @ jacobian
    return null_vectors(normal, np.diag(normal), names)


def printed_b1(view) -> np.ndarray:
    """The Jacobian of one view with b1 as the paper prints it: dx = −b1·x, dy = −b1·y."""
    jacobian = parameter_derivatives(replace(view, b=(0.0,) * 9), frame())
    jacobian[:, 1, PARAMETERS.index("b1")] *= -1.0
    return jacobian.reshape(-1, len(PARAMETERS))


def test_a_calibration_frame_with_depth_determines_everything():
    check_rank(network(start=rough()), tied())
    check_rank(network(target_sigma_mm=0.02), Unknowns.of(TRUE, shared=LENS))
    check_rank(network(sigma_px=0.002, target_sigma_mm=0.01), Unknowns.of(TRUE))


@pytest.mark.parametrize("views", [TRUE, tuple(replace(view, b=(0.0,) * 9) for view in TRUE)])
def test_a_planar_calibration_frame_is_refused_with_the_names_of_what_it_confounds(views):
    with pytest.raises(RankDeficient, match=r"left\.f_mm") as refused:
        check_rank(network(views, PLANE), tied())
    named = refused.value.parameters
    assert {"left.f_mm", "right.f_mm", "left.x0_px", "right.y0_px"} <= set(named)
    assert not [name for name in named if ".b" in name]
    assert "depth" in refused.value.hint


def test_a_planar_calibration_frame_has_three_null_vectors_a_view():
    view = replace(TRUE[0], b=(0.0,) * 9)
    found = null_vectors_of(parameter_derivatives(view, PLANE).reshape(-1, 18), PARAMETERS)
    assert len(found) == 3
    assert {"f_mm", "x0_px", "y0_px"} <= {name for vector in found for name in vector.parameters}


def test_a_planar_calibration_frame_is_refused_although_distortion_hides_it():
    strong = tuple(replace(view, b=tuple(np.multiply(view.b, 10))) for view in TRUE)
    assert adjust(network(strong, PLANE, sigma_px=1e-3), tied()).freedom > 0
    with pytest.raises(RankDeficient):
        check_rank(network(strong, PLANE), tied())


def test_a_planar_calibration_frame_is_enough_where_the_interior_is_held():
    free = [name for name in PARAMETERS if name not in {"f_mm", "x0_px", "y0_px"}]
    check_rank(network(places=PLANE), Unknowns.of(TRUE, free, tied=True))


def test_a_frame_of_too_little_depth_is_refused_by_its_depth():
    shallow = frame() * [1.0, 1.0, 0.1]
    with pytest.raises(RankDeficient, match="lie in a plane") as refused:
        check_rank(network(places=shallow), tied())
    assert "left.f_mm" in refused.value.parameters
    check_rank(network(places=frame() * [1.0, 1.0, 0.5]), tied())


def test_the_printed_b1_is_a_scale_and_confounded_with_the_focal_length():
    (vector,) = null_vectors_of(printed_b1(TRUE[0]), PARAMETERS)
    assert set(vector.parameters) == {"f_mm", "b1"}
    assert np.abs(vector.shares) == pytest.approx([0.707, 0.707], abs=0.02)
    assert "f_mm" in str(vector)


def test_b1_as_an_affinity_is_not():
    view = replace(TRUE[0], b=(0.0,) * 9)
    assert null_vectors_of(parameter_derivatives(view, frame()).reshape(-1, 18), PARAMETERS) == ()


def test_a_column_of_zeros_is_a_null_vector_by_itself():
    jacobian = np.random.default_rng(1).normal(size=(9, 3)) * [1.0, 0.0, 1e-9]
    (vector,) = null_vectors_of(jacobian, ("a", "b", "c"))
    assert vector.parameters == ("b",)
    assert vector.shares == (pytest.approx(1.0),)


def test_separate_null_vectors_are_named_separately():
    base = np.random.default_rng(1).normal(size=(20, 4))
    jacobian = np.column_stack([base[:, 0], base[:, 1], base[:, 2], base[:, 0] * 3, base[:, 1] - base[:, 2]])
    found = null_vectors_of(jacobian, "abcde")
    assert sorted("".join(sorted(vector.parameters)) for vector in found) == ["ad", "bce"]


def test_fewer_observations_than_parameters_leave_null_vectors():
    assert len(null_vectors_of(np.random.default_rng(1).normal(size=(2, 5)), "abcde")) == 3


def test_targets_of_unknown_place_leave_the_datum_undetermined():
    free = network(target_sigma_mm=np.inf)
    with pytest.raises(RankDeficient, match="X0_mm"):
        check_rank(free, Unknowns.of(TRUE, PARAMETERS[3:9]))


def test_a_view_without_pictures_is_named():
    one = network()
    with pytest.raises(RankDeficient) as refused:
        check_rank(one.select(one.view == 0), tied())
    assert {name for name in refused.value.parameters if name.startswith("left")} == set()
    assert "right.f_mm" in refused.value.parameters


def test_a_start_behind_a_camera_is_no_matter_of_rank():
    behind = tuple(replace(view, Z0_mm=-view.Z0_mm) for view in TRUE)
    with pytest.raises(MeasurementError, match="behind a camera"):
        check_rank(network(start=behind), tied())
