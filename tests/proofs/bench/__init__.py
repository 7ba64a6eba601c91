"""Units of the work, measured. `python -m tests.proofs.bench` prints tables; nothing here passes or fails."""
