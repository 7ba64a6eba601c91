"""Guided tests: asked for, evaluated in a job, kept, shown and reported, and their offers accepted."""
