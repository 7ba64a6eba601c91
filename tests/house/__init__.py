"""Checks and counts of the source itself: words in names, sizes of files, import cycles, hops."""
