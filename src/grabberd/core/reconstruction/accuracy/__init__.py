"""Accuracy of points (paper 4): against the truth, between targets, and against the calibration.

`accuracy` is the paper's Table 1, `pointing` the precision of image coordinates at rest, `length_errors` the
verification after VDI/VDE 2634; `drift_check` detects from the parallax whether the rig has moved since its
calibration.
"""
