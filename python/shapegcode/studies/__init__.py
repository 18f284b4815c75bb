"""What a machine that is not known exactly does to a program: drawn machines, quantiles, what decides."""
