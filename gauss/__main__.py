"""`python -m gauss` is the command line."""

import sys

from gauss.cli import main

sys.exit(main())
