"""The whole daemon in simulated time and weather, played by a seed, and what holds it to its promises."""
