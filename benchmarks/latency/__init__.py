"""First motion of a scene in a fresh process: cold, warm, steady."""
