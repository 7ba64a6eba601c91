"""The API's description: OpenAPI completed, and the page drawn from it."""
