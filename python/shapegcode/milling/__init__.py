"""Milling: what describes tool, stock and material, and what is computed from them."""
