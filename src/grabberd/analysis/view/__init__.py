"""What the cameras would see of the surface: the synthetic view."""
