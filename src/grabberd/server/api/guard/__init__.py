"""Admission of every request before a route sees it.

`gate` is the middleware that applies the checks in order: host name and origin (`front`), token or session
and role (`authentication`), size and duration of the body (`limits`). A check that fails raises a
`Refusal`. `limits` also limits connections and live streams per client.
"""
