"""The known calibrations, which of them each device measures with, and the known calibration frames."""
