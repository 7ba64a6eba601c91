"""Commands that a running daemon carries out for the command line, over HTTP."""
