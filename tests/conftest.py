"""Settings shared by all tests."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # pytest-xdist already uses every core

from hypothesis import settings  # noqa: E402

settings.register_profile("gauss", deadline=None, derandomize=True)
settings.load_profile("gauss")
