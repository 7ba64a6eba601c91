"""One grabber as an instrument: its threads, ring, threshold, recovery, status and live points."""
