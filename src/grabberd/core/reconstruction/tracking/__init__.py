"""Tracking: the same targets from field to field (paper 3.7).

A `Track` is all that is known after a field; the `Tracker` steps from one to the next, by following the
targets near their predicted positions, or by identifying them anew. It stands on `correspondence` and keeps
no state itself.
"""
