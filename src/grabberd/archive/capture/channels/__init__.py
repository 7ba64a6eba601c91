"""Channels in a capture file: what was measured beside the picture, in groups of half a second.

Values are kept as the logger gave them, bit for bit, beside the calibration that turns them into kPa; times
are those of the fields' own clock. The account says what is missing, and why.
"""
