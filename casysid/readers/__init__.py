"""Logs on disk to recordings: formats, column names, faults and weaknesses."""
