"""Common parts of all results: figures, tables, plots, JSON."""
