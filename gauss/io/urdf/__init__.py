"""URDF: robots read through Pinocchio's parser, with a side file for elements beyond the format; scenes written."""
