"""What a machine that is not known exactly does to a program: sampled machines, quantiles, what decides."""
