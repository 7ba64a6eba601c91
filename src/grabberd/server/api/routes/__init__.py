"""The routes, one module per noun: each calls the service and returns its document.

A route neither builds nor changes documents; it checks parameters, picks the status code and sets headers.
`dependencies` holds the parameters and responses that several of them share.
"""
