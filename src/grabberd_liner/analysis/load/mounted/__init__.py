"""The mounted liner: its open wall, where on it the targets are glued, and what a field sees of them."""
