"""From a program to its shaped program, judged."""
