"""The documented path of calibration."""

from grabberd.core.calibration import *  # noqa: F403
