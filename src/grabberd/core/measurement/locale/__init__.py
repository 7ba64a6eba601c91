"""Locale decoding: the best estimate of a target's position at 1 bit, from all positions that explain its
bits.

`locale_model` gives the probability of each pixel, `locale_table` tabulates it over a fine grid,
`locale_sizes` and `locale_patterns` prepare the blobs, `locale_posterior` looks them up; `locale` is the
locator, `locale_prediction` the error to expect, by which thresholds are chosen.
"""
