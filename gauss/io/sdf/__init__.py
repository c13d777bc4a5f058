"""SDFormat files, read with their loops."""
