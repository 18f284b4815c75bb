"""What programs would measure on the part."""
