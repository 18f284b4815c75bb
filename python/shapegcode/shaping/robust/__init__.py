"""Shapers that hold over bands of frequency."""
