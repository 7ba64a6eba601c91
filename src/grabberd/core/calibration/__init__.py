"""Calibration: the rig's parameters from pictures of known targets (paper 3.6).

A `Network` states which blob is which target in which view, and their σ; `Unknowns` which of the views'
parameters are free, held, shared or tied; `adjust` estimates them, for any number of views and targets.
`mean_images` averages the pictures before, `identification` names the targets in them. Afterwards
`residuals`, `significance` and `validation` judge the adjustment, `calibration_frame` and `rig_quantities`
what it was made from and what came out, and `volume_sigma` predicts the σ of points; `local_field_trial`
describes what the model leaves, `glass_transfer` adds a glass plate. `exchange` reads other programs'
networks, `control_points` their lists of known points.
"""

from grabberd.core.calibration.adjustment.adjustment import (
    Adjustment,
    AdjustmentSettings,
    adjust,
    intersect_network,
    propagate,
)
from grabberd.core.calibration.adjustment.frame_poses import (
    FramePose,
    PosedUnknowns,
    frame_poses,
    joined,
    of_first_pose,
)
from grabberd.core.calibration.adjustment.network import LENS, Network, Unknowns
from grabberd.core.calibration.adjustment.rank import check_depth, check_rank
from grabberd.core.calibration.adjustment.starting_values import POSE, pose, resect, with_starting_values
from grabberd.core.calibration.calibration_frame import (
    DisplacedTarget,
    GridOrder,
    Symmetry,
    displaced_targets,
    grid_order,
    swapped_axes,
    symmetries,
    target_to_add,
    undecided,
)
from grabberd.core.calibration.control_points import ControlPoint, read_control_points
from grabberd.core.calibration.exchange import read_photomodeler
from grabberd.core.calibration.glass_transfer import with_glass
from grabberd.core.calibration.identification.frame_identification import (
    Identification,
    IdentificationSettings,
    ViewIdentification,
    handedness_hint,
    identify_frame,
)
from grabberd.core.calibration.identification.manual_identification import Mark, identify_by_hand
from grabberd.core.calibration.local_field_trial import LocalFieldSettings, LocalFieldTrial, try_local_fields
from grabberd.core.calibration.mean_images import FieldImages, MeanImages, Stillness, mean_images, stillness
from grabberd.core.calibration.residuals import (
    Blunder,
    Normality,
    Pattern,
    normality,
    residual_patterns,
    with_unmodelled,
    without_blunders,
)
from grabberd.core.calibration.rig_quantities import (
    RigQuantity,
    base_mm,
    compared_rig,
    convergence_deg,
    distance_mm,
)
from grabberd.core.calibration.significance import (
    Difference,
    Elimination,
    compare,
    eliminate,
    f_tests,
    with_stated_covariance,
)
from grabberd.core.calibration.validation import (
    CheckLength,
    MeasuredLength,
    Validation,
    cross_validate,
    measured_length,
    spatial_blocks,
)
from grabberd.core.calibration.volume_sigma import VolumeSigma, volume_sigma

__all__ = [
    "LENS",
    "POSE",
    "Adjustment",
    "AdjustmentSettings",
    "Blunder",
    "CheckLength",
    "ControlPoint",
    "Difference",
    "DisplacedTarget",
    "Elimination",
    "FieldImages",
    "FramePose",
    "GridOrder",
    "Identification",
    "IdentificationSettings",
    "LocalFieldSettings",
    "LocalFieldTrial",
    "Mark",
    "MeanImages",
    "MeasuredLength",
    "Network",
    "Normality",
    "Pattern",
    "PosedUnknowns",
    "RigQuantity",
    "Stillness",
    "Symmetry",
    "Unknowns",
    "Validation",
    "ViewIdentification",
    "VolumeSigma",
    "adjust",
    "base_mm",
    "check_depth",
    "check_rank",
    "compare",
    "compared_rig",
    "convergence_deg",
    "cross_validate",
    "displaced_targets",
    "distance_mm",
    "eliminate",
    "f_tests",
    "frame_poses",
    "grid_order",
    "handedness_hint",
    "identify_by_hand",
    "identify_frame",
    "intersect_network",
    "joined",
    "mean_images",
    "measured_length",
    "normality",
    "of_first_pose",
    "pose",
    "propagate",
    "read_control_points",
    "read_photomodeler",
    "resect",
    "residual_patterns",
    "spatial_blocks",
    "stillness",
    "swapped_axes",
    "symmetries",
    "target_to_add",
    "try_local_fields",
    "undecided",
    "volume_sigma",
    "with_glass",
    "with_starting_values",
    "with_stated_covariance",
    "with_unmodelled",
    "without_blunders",
]
