"""The documented path of calibration."""

# ruff: noqa: F403, F405

from grabberd.core.calibration.adjustment.adjustment import *
from grabberd.core.calibration.adjustment.frame_poses import *
from grabberd.core.calibration.adjustment.network import *
from grabberd.core.calibration.adjustment.normal_equations import *
from grabberd.core.calibration.adjustment.starting_values import *
from grabberd.core.calibration.calibration_frame import *
from grabberd.core.calibration.control_points import *
from grabberd.core.calibration.dbat_script import *
from grabberd.core.calibration.exchange import *
from grabberd.core.calibration.identification.decision import *
from grabberd.core.calibration.identification.frame_identification import *
from grabberd.core.calibration.identification.manual_identification import *
from grabberd.core.calibration.identification.rig_hypothesis import *
from grabberd.core.calibration.local_field_trial import *
from grabberd.core.calibration.mean_images import *
from grabberd.core.calibration.residuals import *
from grabberd.core.calibration.rig_quantities import *
from grabberd.core.calibration.significance import *
from grabberd.core.calibration.validity import *

__all__ = [
    "LENS",
    "MOST_EXAMINED",
    "POSE",
    "Adjustment",
    "AdjustmentSettings",
    "Blunder",
    "CheckLength",
    "ControlPoint",
    "Difference",
    "DiscNetwork",
    "DisplacedTarget",
    "Elimination",
    "FieldImages",
    "FramePose",
    "GridOrder",
    "Identification",
    "IdentificationSettings",
    "LeftOver",
    "LocalFieldSettings",
    "LocalFieldTrial",
    "Mark",
    "MeanImages",
    "MeasuredLength",
    "Network",
    "Normality",
    "Orientation",
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
    "identify_by_hand",
    "identify_frame",
    "intersect_network",
    "joined",
    "mean_images",
    "measured_length",
    "mirrored_hint",
    "normality",
    "of_first_pose",
    "pitch_mm",
    "pose",
    "propagate",
    "read_control_points",
    "read_dbat_script",
    "read_photomodeler",
    "resect",
    "residual_patterns",
    "spatial_blocks",
    "stillness",
    "swapped_axes",
    "symmetries",
    "targets_to_add",
    "try_local_fields",
    "turns_hint",
    "undecided",
    "volume_sigma",
    "with_glass",
    "with_starting_values",
    "with_stated_covariance",
    "with_unmodelled",
    "without_blunders",
]
