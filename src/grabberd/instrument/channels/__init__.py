"""Channels in the running daemon: a thread for each logger, its newest readings, and those for captures.

A logger that is absent, stops, jumps or delivers nonsense delays nothing: taking fields, recording and
stopping use the readings that exist, and never wait beyond a deadline.
"""
