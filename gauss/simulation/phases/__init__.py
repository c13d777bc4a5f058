"""Event-driven integration of unilateral and set-valued elements: smooth phases between events."""
