"""Calibration: the rig's parameters from pictures of known targets (paper 3.6).

A `Network` states which blob is which target in which view, and their σ; `Unknowns` which of the views'
parameters are free, held, shared or tied; `adjust` estimates them, for any number of views and targets.
`mean_images` averages the pictures beforehand and `identification` names the targets in them; afterwards
`statistics` and `acceptance` judge the result, `local_field` describes what the model leaves, and
`glass_transfer` carries a calibration over to a glass plate. `exchange` reads networks of other programs.
"""

from grabberd.core.calibration.acceptance.check_length import CheckLength, MeasuredLength, measured_length
from grabberd.core.calibration.acceptance.displaced_targets import (
    DisplacedTarget,
    displaced_targets,
    swapped_axes,
)
from grabberd.core.calibration.acceptance.frame_symmetry import Symmetry, symmetries, target_to_add, undecided
from grabberd.core.calibration.acceptance.grid_order import GridOrder, grid_order
from grabberd.core.calibration.acceptance.residual_pattern import Pattern, residual_patterns
from grabberd.core.calibration.acceptance.rig_quantities import (
    RigQuantity,
    base_mm,
    compared_rig,
    convergence_deg,
    distance_mm,
)
from grabberd.core.calibration.acceptance.stillness import Stillness, stillness
from grabberd.core.calibration.adjustment.adjustment import Adjustment, adjust
from grabberd.core.calibration.adjustment.frame_poses import (
    FramePose,
    PosedUnknowns,
    frame_poses,
    joined,
    of_first_pose,
)
from grabberd.core.calibration.adjustment.levenberg_marquardt import AdjustmentSettings
from grabberd.core.calibration.adjustment.network import Network
from grabberd.core.calibration.adjustment.propagation import intersect_network, propagate
from grabberd.core.calibration.adjustment.rank import check_depth, check_rank
from grabberd.core.calibration.adjustment.resection import resect
from grabberd.core.calibration.adjustment.starting_values import POSE, pose, with_starting_values
from grabberd.core.calibration.adjustment.unknowns import LENS, Unknowns
from grabberd.core.calibration.adjustment.unmodelled import with_unmodelled
from grabberd.core.calibration.exchange.photomodeler import (
    ControlPoint,
    read_control_points,
    read_photomodeler,
)
from grabberd.core.calibration.glass_transfer import with_glass
from grabberd.core.calibration.identification.acceptance import IdentificationSettings, handedness_hint
from grabberd.core.calibration.identification.frame_identification import (
    Identification,
    ViewIdentification,
    identify_frame,
)
from grabberd.core.calibration.identification.manual_identification import Mark, identify_by_hand
from grabberd.core.calibration.local_field.local_field_trial import (
    LocalFieldSettings,
    LocalFieldTrial,
    try_local_fields,
)
from grabberd.core.calibration.mean_images import FieldImages, MeanImages, mean_images
from grabberd.core.calibration.statistics.blunders import Blunder, without_blunders
from grabberd.core.calibration.statistics.cross_validation import Validation, cross_validate, spatial_blocks
from grabberd.core.calibration.statistics.normality import Normality, normality
from grabberd.core.calibration.statistics.significance import Elimination, eliminate, f_tests
from grabberd.core.calibration.statistics.stated_covariance import with_stated_covariance
from grabberd.core.calibration.statistics.view_comparison import Difference, compare
from grabberd.core.calibration.statistics.volume_sigma import VolumeSigma, volume_sigma

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
