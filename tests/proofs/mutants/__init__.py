"""Seeded mutants of functions, wherever these live: `python -m tests.proofs.mutants`."""
