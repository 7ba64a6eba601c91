"""The bundle adjustment (paper 3.6): network, unknowns, normal equations, iteration, propagation."""
