"""Proofs that the program stays what it was while its source is restructured."""
