"""Inverse: groups of surfaces, their models as nodes, and the search with Cycles in the loop."""
