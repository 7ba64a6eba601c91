"""Accuracy of points (paper 4): against the truth, between targets, and against the calibration.

`accuracy` is the paper's Table 1, `length_errors` the verification after VDI/VDE 2634, `pointing` the
precision of image coordinates at rest; `parallax` and `drift_check` tell whether the rig has moved since its
calibration.
"""
