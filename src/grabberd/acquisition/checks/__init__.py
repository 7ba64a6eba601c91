"""Checks of a live field's content: no picture, stale rows, shifted rows."""
