"""Identification of the calibration frame's targets among the blobs, without any click.

Every target is tried at a few blobs, rotated and mirrored (`poses`); hypotheses grow over the calibration
frame (`hypothesis_growth`), and the best is challenged by its neighbours a pitch away (`hypothesis_ranking`).
Both views must then agree with each other and with the nominal rig (`acceptance`). What stays ambiguous
is refused, and can be decided by marking some targets (`manual_identification`).
"""
