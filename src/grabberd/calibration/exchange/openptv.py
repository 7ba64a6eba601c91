"""The documented path of the reader of OpenPTV's files."""

from grabberd.core.calibration.adjustment.network import matched
from grabberd.core.calibration.control_points import read_calibration_points
from grabberd.core.calibration.exchange import Sensor, read_orientation, read_targets

__all__ = ["Sensor", "matched", "read_calibration_points", "read_orientation", "read_targets"]
