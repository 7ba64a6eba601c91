"""Captures on disk: one SQLite database each, what is exported from them, and the state that outlives them.

A capture file is crash-safe and readable with any SQLite reader; `docs/reference/capture-file.md` describes
it. It is called `NAME.grab.part` while it is written and `NAME.grab` once it is sealed.
"""
