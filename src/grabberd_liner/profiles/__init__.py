"""Profiles of liners, pulsators, cups and cows: read, stored by versions, found by the labels of captures."""
