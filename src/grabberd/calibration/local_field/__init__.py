"""The local fields: what a view's picture shows beyond the global model (decision 0005)."""
