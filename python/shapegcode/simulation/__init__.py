"""A program played on the machine: figures and motion."""
