"""The OpenAPI description, completed with roles and problems, and the page drawn from it."""
