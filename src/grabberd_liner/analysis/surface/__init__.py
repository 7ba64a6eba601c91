"""The smooth surface through a field's points, and what is measured on it."""
