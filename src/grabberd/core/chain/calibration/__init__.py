"""From fields of the calibration frame to a calibration, its report document and its checks (paper 3.6)."""
