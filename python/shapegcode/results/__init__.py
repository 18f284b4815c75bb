"""What every result shares: figures, tables, plots, JSON."""
