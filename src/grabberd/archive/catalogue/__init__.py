"""The captures on disk: found, listed, described, annotated, and removed when their time is over."""
