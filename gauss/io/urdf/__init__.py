"""URDF: robots read through Pinocchio's parser, with a side file for what the format cannot say; scenes written."""
