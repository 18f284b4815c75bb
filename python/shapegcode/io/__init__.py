"""Reads measurements and other files, and writes files."""
