"""The rig's numbers from pictures of known targets (paper 3.6): adjustment, significance, validation.

A `Network` says which blob is which target in which view and how well each is known, `Unknowns` which of the
views' parameters are sought, held, shared or tied; `adjust` finds them. Any number of views and targets.
"""

from grabberd.calibration.adjustment import Adjustment, AdjustmentSettings, adjust
from grabberd.calibration.network import Network
from grabberd.calibration.unknowns import Unknowns

__all__ = ["Adjustment", "AdjustmentSettings", "Network", "Unknowns", "adjust"]
