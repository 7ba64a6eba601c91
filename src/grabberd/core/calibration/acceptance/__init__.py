"""Acceptance of a calibration: what speaks against trusting it, beyond the adjustment's own statistics.

Beforehand, whether the calibration frame can tell its targets apart at all (`frame_symmetry`) and whether its
file keeps its own grid (`grid_order`). Afterwards, whether targets stand elsewhere than in that
file (`displaced_targets`), whether the rig that was found is the one that was built (`rig_quantities`),
whether the scale is right (`check_length`), whether everything stood still (`stillness`), and whether
neighbouring residuals agree (`residual_pattern`).
"""
