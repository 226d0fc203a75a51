"""What is chosen from the data before the fit: each choice a value with its evidence."""
