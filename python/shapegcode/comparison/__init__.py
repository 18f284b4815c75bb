"""Two programs side by side: what one does and the other does not."""
