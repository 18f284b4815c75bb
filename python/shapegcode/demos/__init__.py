"""Reproductions of papers' figures: one file each."""
