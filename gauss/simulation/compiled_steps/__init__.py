"""What compiled loops call, written down for the system at hand."""
