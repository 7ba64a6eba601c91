"""Stored calibrations, and which of them each device measures with."""
