"""From fields to points: arrays in, arrays out; no clock, thread, file or log (paper figures 3, 4, 6, 8, 10)."""
