"""How good points are: against the truth, between targets, and against the calibration they were made with
(paper 4).
"""
