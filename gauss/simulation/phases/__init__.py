"""One-sided constraints and grips: phases between events."""
