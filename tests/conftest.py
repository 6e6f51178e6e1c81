"""Hypothesis profiles."""

import os

from hypothesis import settings

# Fewer examples on every push; the weekly run draws many, and new ones.
settings.register_profile("ci", deadline=None, derandomize=True, max_examples=30)
settings.register_profile("random", deadline=None, max_examples=500)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))
