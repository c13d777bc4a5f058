"""`python -m gauss` is the command line, and so is the installed command."""

import sys

INTERRUPTED = 130  # exit code of what Ctrl-C has ended


def main():
    """Entry point: the command line is imported here, so that Ctrl-C ends the import without a traceback, too."""
    try:
        from gauss.cli import main as command

        return command()
    except KeyboardInterrupt:
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
