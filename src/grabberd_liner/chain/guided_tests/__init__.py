"""Guided tests of a liner: what its analyses say, check by check, and what they offer to its profile."""
