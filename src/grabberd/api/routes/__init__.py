"""The routes, one file a resource, and the models of what they take and return."""
