"""Location by the compiled kernel; the numpy twins stand in the rooms beside it."""
