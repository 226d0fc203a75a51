"""A designed motion on the way to a robot: approach, speed, collisions, files."""
