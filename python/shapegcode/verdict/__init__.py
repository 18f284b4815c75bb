"""Programs simulated under operating conditions and judged: every cut, shaped or left unchanged."""
