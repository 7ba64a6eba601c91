"""Months of a barn in minutes: one fault after the other, by lot, and everything accounted for."""
