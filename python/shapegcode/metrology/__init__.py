"""Virtual metrology: measures the simulated part."""
