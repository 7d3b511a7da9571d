"""What all tests share."""

from __future__ import annotations

import os
import tempfile

from hypothesis import settings

os.environ.setdefault("MPLBACKEND", "Agg")
os.environ["FLOATBASE_HOME"] = tempfile.mkdtemp(prefix="floatbase-")  # a learner's progress is not the tests' to write
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices of 30 rows: more threads only wait for one another

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")
