"""Faults of the daemon itself: told and counted, its descriptors shared, its state database recovered."""
