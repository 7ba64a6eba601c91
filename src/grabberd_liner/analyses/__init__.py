"""Analyses of captures: asked for, computed in a job, kept, shown and exported."""
