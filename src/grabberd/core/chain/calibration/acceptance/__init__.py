"""Acceptance of a calibration: one verdict and its reasons, each with what was found and what to do.

`verdict` collects the reasons and writes all of it as a document: from the rig and the check length
(`rig_reasons`), from the calibration frame, its pictures and the adjustment (`reasons`, where values are
graded).
"""
