"""Classes of instances, a module each: ``recipes()`` yields names, and functions that make the instances."""
