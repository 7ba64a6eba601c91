"""Acceptance of a calibration: one verdict and its reasons, each with what was found and what to do.

`verdict` collects the reasons: from the check length (`length_reasons`), the rig (`rig_reasons`), the
calibration frame's file and the names of its targets (`frame_reasons`), the pictures (`picture_reasons`) and
the adjustment (`adjustment_reasons`). Values are graded in `reason`; `acceptance_document` writes all of it.
"""
