"""Calibration: the rig's parameters from pictures of known targets (paper 3.6).

A `Network` states which blob is which target in which view, and their σ; `Unknowns` which of the views'
parameters are free, held, shared or tied; `adjust` estimates them, for any number of views and targets.
`mean_images` averages the pictures before, `identification` names the targets in them. Afterwards
`residuals`, `significance` and `validation` judge the adjustment, `calibration_frame` and `rig_quantities`
what it was made from and what came out, and `volume_sigma` predicts the σ of points; `local_field_trial`
describes what the model leaves, `glass_transfer` adds a glass plate. `exchange` reads other programs'
networks, `control_points` their lists of known points.
"""
