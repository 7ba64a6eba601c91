"""Smoothing of points over time (paper 3.7): motion model, filter, and errors that are not white.

`kalman_chains` is the filter and smoother, `manoeuvres` finds the acceleration of every interval,
`error_shares` divides the errors into a white part and parts that
stay with the target's position between the pixels, `smoothing` puts the two to work on a series of points.
"""
