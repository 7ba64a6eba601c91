"""Which blob is which target of the calibration frame, without a click: grown, contested, or refused.

Every target is tried at a few blobs, turned and mirrored; hypotheses grow over the calibration frame, and the
best is challenged by its neighbours a pitch away. Both views then have to agree with each other and with the
rig as it was built.
"""

from grabberd.calibration.identification.frame_identification import (
    Identification,
    ViewIdentification,
    identify_frame,
)
from grabberd.calibration.identification.identification_settings import IdentificationSettings
from grabberd.calibration.identification.manual_identification import Mark, identify_by_hand

__all__ = [
    "Identification",
    "IdentificationSettings",
    "Mark",
    "ViewIdentification",
    "identify_by_hand",
    "identify_frame",
]
