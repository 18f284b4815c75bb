"""Verdict of programs: every cut, shaped or left unchanged, is simulated under the operating conditions."""
