"""A ramp of the vacuum with the empty liner: its modulus, thickness and pretension, buckling and touch."""
