"""Captures from request to sealed file: control, start, recorder, writer, disk guard."""
