"""Points smoothed over time (paper 3.7): the motion model, the filter, and the errors it allows for."""
