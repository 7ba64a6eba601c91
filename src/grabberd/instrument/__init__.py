"""The running instrument: grabbers and loggers with their threads, and captures in the making."""
