"""Line jitter: the shift of every line solved for, and what remains of it (decision 0006)."""
