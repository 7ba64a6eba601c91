"""The capture file: written, read, sealed, recovered."""
