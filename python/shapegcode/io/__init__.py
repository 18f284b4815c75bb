"""Measured and written files."""
