"""Bundle adjustment (paper 3.6): least squares for the views' parameters and the targets' positions.

`network` and `unknowns` are its input, `normal_equations` eliminates the positions, `levenberg_marquardt`
iterates, `adjustment` is the result with its covariance. `rank` refuses what the pictures cannot determine,
`resection` finds one view roughly, `propagation` carries errors to points, `unmodelled` estimates the error
that image points share.
"""
