"""Guided tests as the daemon knows them: listed, asked for by hand, and their offers accepted."""
