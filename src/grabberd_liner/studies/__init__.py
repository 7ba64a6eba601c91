"""Finds the captures of a study, with their analyses: in folders of results, or in an archive."""
