"""Quantities of a load: liner compression and teat load over height, in the closed liner, and first touch."""
