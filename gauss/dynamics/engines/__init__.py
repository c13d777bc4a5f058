"""Where accelerations come from along a motion: one engine a file."""
