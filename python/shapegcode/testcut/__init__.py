"""Test cuts: their design, their programs, and fits to their records."""
