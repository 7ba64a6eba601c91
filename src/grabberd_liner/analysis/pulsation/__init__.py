"""The pulsation: cycles, phases, the mean cycle."""
