"""How long a program takes."""
