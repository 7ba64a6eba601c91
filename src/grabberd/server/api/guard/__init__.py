"""Admission of every request before a route sees it.

`gate` is the middleware that applies the checks one after the other: host name and origin (`front`), token or
session (`authentication`), role (`roles`), size and time of the body (`limits`). A check that fails raises a
`Refusal`. `limits` also has those of connections and of the live streams to one client.
"""
