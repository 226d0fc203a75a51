"""Motions along finite Fourier series, and what each joint may do."""
