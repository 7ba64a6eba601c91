"""The core, from fields to points: arrays in, arrays out, without clocks, threads, files or logs.

Its rooms follow the paper's own decomposition (figures 3, 4, 6, 8 and 10).
"""
