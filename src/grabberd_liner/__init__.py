"""The liner science: shape, strain, tension and the pressure on the teat, from what an instrument has kept."""
