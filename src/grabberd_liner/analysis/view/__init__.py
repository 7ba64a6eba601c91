"""The synthetic view: the surface as the cameras would see it."""
