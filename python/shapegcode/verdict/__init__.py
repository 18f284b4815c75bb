"""Verdict of programs: every cut, shaped or left unchanged, simulated in conditions that count."""
