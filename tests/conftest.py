"""What holds for every test: one numerical thread, as in the service; hypothesis draws the same examples on every run,
and waits for no clock."""

from __future__ import annotations

from hypothesis import settings

import service as service  # sets the threads, before NumPy is loaded

settings.register_profile("seeded", derandomize=True, deadline=None)
settings.load_profile("seeded")
