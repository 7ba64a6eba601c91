"""Locale decoding: the best place of a target at 1 bit, from all places that explain its bits."""
