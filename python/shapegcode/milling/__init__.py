"""Milling: files that describe tool, stock and work material."""
