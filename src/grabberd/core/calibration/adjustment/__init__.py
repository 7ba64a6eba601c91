"""Bundle adjustment (paper 3.6): least squares for the views' parameters and the targets' positions.

`network` is its input, `normal_equations` eliminates the positions, `adjustment` iterates to the result with
its covariance, and carries errors to points. `rank` refuses what the pictures cannot determine,
`starting_values` finds views roughly, `frame_poses` joins several poses of the calibration frame.
"""
