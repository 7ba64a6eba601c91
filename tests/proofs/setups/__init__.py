"""Wrong set-ups for a calibration, and what the user is told of each: `make setups` writes the table."""
