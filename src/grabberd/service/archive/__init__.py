"""The captures on disk: listed, described, annotated, retained."""
