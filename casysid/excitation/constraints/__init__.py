"""What a motion has to keep: joint limits, torque, distances, boxes; each with its derivatives."""
