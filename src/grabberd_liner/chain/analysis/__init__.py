"""From a capture's points to shape, strain, tension and pressure, as tables and one document (paper 3.8)."""
