"""Feeds set by cutting force and deflection."""
