"""Channels while the daemon runs: a thread for each logger, its newest readings, what captures take of them.

A logger that is absent, stops, jumps or says nonsense delays nobody: whoever takes fields, records or ends
looks at what there is, and never waits for more than a deadline.
"""
