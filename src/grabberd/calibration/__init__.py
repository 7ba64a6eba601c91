"""Calibration: the rig's parameters from pictures of known targets (paper 3.6).

A `Network` states which blob is which target in which view, and their σ; `Unknowns` which of the views'
parameters are free, held, shared or tied; `adjust` estimates them, for any number of views and targets.
`mean_images` averages the pictures beforehand and `identification` names the targets in them; afterwards
`statistics` judges the result, `local_field` describes what the model leaves, and `glass_transfer` carries a
calibration over to a glass plate.
"""

from grabberd.calibration.adjustment.adjustment import Adjustment, adjust
from grabberd.calibration.adjustment.levenberg_marquardt import AdjustmentSettings
from grabberd.calibration.adjustment.network import Network
from grabberd.calibration.adjustment.propagation import intersect_network, propagate
from grabberd.calibration.adjustment.rank import check_depth, check_rank
from grabberd.calibration.adjustment.resection import resect
from grabberd.calibration.adjustment.unknowns import LENS, Unknowns
from grabberd.calibration.adjustment.unmodelled import with_unmodelled
from grabberd.calibration.glass_transfer import with_glass
from grabberd.calibration.identification.acceptance import IdentificationSettings
from grabberd.calibration.identification.frame_identification import (
    Identification,
    ViewIdentification,
    identify_frame,
)
from grabberd.calibration.identification.manual_identification import Mark, identify_by_hand
from grabberd.calibration.local_field.local_field_trial import (
    LocalFieldSettings,
    LocalFieldTrial,
    try_local_fields,
)
from grabberd.calibration.mean_images import FieldImages, MeanImages, mean_images
from grabberd.calibration.statistics.blunders import Blunder, without_blunders
from grabberd.calibration.statistics.cross_validation import Validation, cross_validate, spatial_blocks
from grabberd.calibration.statistics.normality import Normality, normality
from grabberd.calibration.statistics.significance import Elimination, eliminate, f_tests
from grabberd.calibration.statistics.stated_covariance import with_stated_covariance
from grabberd.calibration.statistics.view_comparison import Difference, compare
from grabberd.calibration.statistics.volume_sigma import VolumeSigma, volume_sigma

__all__ = [
    "LENS",
    "Adjustment",
    "AdjustmentSettings",
    "Blunder",
    "Difference",
    "Elimination",
    "FieldImages",
    "Identification",
    "IdentificationSettings",
    "LocalFieldSettings",
    "LocalFieldTrial",
    "Mark",
    "MeanImages",
    "Network",
    "Normality",
    "Unknowns",
    "Validation",
    "ViewIdentification",
    "VolumeSigma",
    "adjust",
    "check_depth",
    "check_rank",
    "compare",
    "cross_validate",
    "eliminate",
    "f_tests",
    "identify_by_hand",
    "identify_frame",
    "intersect_network",
    "mean_images",
    "normality",
    "propagate",
    "resect",
    "spatial_blocks",
    "try_local_fields",
    "volume_sigma",
    "with_glass",
    "with_stated_covariance",
    "with_unmodelled",
    "without_blunders",
]
