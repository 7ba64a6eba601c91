"""Programs that make what the project commits, and are no part of it at run time."""
