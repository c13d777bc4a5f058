"""Questions with committed answers: each script prints and writes what it measured.

They measure optimised machine code, in steady state, unless they say otherwise; what a first result takes is measured in
processes of their own.
"""

import os

os.environ.setdefault("GAUSS_TIER", "optimised")
