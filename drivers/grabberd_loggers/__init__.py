"""Data loggers: serial lines of text, files that grow, MQTT topics, and the kernel's industrial I/O.

The first three deliver lines of text and share all that is said of lines: `lines` says what a line means and
dates it, `line_logger` is the driver that they are sources of.
"""
