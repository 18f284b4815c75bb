"""Studies with uncertain machine parameters: sampled machines, quantiles, influence of each value."""
