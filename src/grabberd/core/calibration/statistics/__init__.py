"""Statistics of an adjustment: what it is worth, and which observations and parameters it should keep.

`blunders` removes wrong image points, `significance` distortion terms that the pictures do not support,
`normality` tests the residuals, `view_comparison` the views against each other; `cross_validation` measures
held-out targets, `volume_sigma` predicts the σ of points over the measuring volume.
"""
