"""``python -m gauss.cli``."""

from gauss.cli import main

main()
