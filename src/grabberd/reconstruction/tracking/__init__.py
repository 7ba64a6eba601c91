"""The same targets from field to field (paper 3.7): the track, its prediction, and the displacement field
behind it.
"""
