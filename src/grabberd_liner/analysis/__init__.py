"""From points to shape, strain, tension and pressure (paper 3.8)."""
