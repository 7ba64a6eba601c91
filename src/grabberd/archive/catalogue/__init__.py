"""The captures on disk: finding, listing, describing, annotating and deleting them."""
