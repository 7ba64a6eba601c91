"""Identification of the calibration frame's targets among the blobs, without any click.

Every target is tried at a few blobs, rotated and mirrored, and grows over the calibration frame
(`hypothesis_growth`); the best hypothesis is challenged by its neighbours a pitch away (`hypothesis`). Both
views must then agree with each other and with the nominal rig (`frame_identification`). What stays ambiguous
is refused, and can be decided by marking some targets (`manual_identification`).
"""
