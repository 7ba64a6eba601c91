"""The known calibrations and calibration frames."""
