"""Laws of loads and prescribed motions: traced or opaque, their switching times and switching functions."""
