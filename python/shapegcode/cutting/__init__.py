"""Tool, stock, materials."""
