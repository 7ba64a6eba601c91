"""From blobs of two views to the points of an object's targets (paper 3.7)."""
