"""The threshold (paper 3.5): chosen for a field or for every pixel of it."""
