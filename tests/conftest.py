"""What all tests share."""

from __future__ import annotations

import os

from hypothesis import settings

os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices of 30 rows: more threads only wait for one another

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")
