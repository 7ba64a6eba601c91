"""Admission of every request before a route sees it.

`gate` is the middleware that applies the checks one after the other: host name and origin, token or session
(`authentication`), role (`roles`), size and time of the body. A check that fails raises a `Refusal`. `front`
holds how the daemon is reached; `connections` limits the connections that requests come in on, and
`stream_limit` the live streams to one client.
"""
