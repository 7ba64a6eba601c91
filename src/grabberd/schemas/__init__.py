"""Schemas: the forms of the files that people write and programs read, as JSON Schema."""
SCHEMAS = {}
def schema_of(name): return {}
