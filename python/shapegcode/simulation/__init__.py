"""A program simulated on the machine: figures and motion."""
