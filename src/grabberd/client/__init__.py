"""A running daemon, asked over HTTP by commands and by Python programs."""
