"""The capture file: one SQLite database, written while it is recorded, sealed, recovered and read.

Its layout is docs/reference/capture-file.md; why it is SQLite with a rollback journal,
docs/decisions/archive.md.
"""
