"""Which blob is which target of the calibration frame, without a click: grown, contested, or refused.

Every target is tried at a few blobs, turned and mirrored; hypotheses grow over the calibration frame, and the
best is challenged by its neighbours a pitch away. Both views then have to agree with each other and with the
rig as it was built.
"""

from grabberd.calibration.identification.by_hand import Mark, identify_by_hand
from grabberd.calibration.identification.identify import Identification, ViewIdentification, identify_frame
from grabberd.calibration.identification.settings import IdentificationSettings

__all__ = [
    "Identification",
    "IdentificationSettings",
    "Mark",
    "ViewIdentification",
    "identify_by_hand",
    "identify_frame",
]
