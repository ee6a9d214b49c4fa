"""How many examples the properties of this folder are tried on: few, or many with --hypothesis-profile=thorough."""

from __future__ import annotations

from hypothesis import settings

FEW, MANY = 60, 1000

settings.register_profile("few", max_examples=FEW, derandomize=True, deadline=None, database=None)
settings.register_profile("thorough", max_examples=MANY, derandomize=True, deadline=None, database=None)
settings.load_profile("few")
