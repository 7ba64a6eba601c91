"""The threshold (paper 3.5): one for a field, or one for every pixel.

`threshold` chooses a grey value from the histogram by a rule, at 1 bit by the predicted error;
`threshold_map` does so for uneven light, and measures the size of the targets, on which the best threshold
depends.
"""
