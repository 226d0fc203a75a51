"""What is to be designed, how good a motion is, and what comes of it."""
