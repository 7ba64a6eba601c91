"""Units of the work, measured. `python -m tests.bench` prints tables; nothing here passes or fails."""
