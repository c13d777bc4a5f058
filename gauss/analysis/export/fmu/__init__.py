"""Functional mock-up units of FMI 3: sources, description, the compiled unit."""
