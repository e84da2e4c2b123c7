"""What holds for every test: hypothesis draws the same examples on every run, and waits for no clock."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("seeded", derandomize=True, deadline=None)
settings.load_profile("seeded")
