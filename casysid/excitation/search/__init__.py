"""The search for the best motion."""
