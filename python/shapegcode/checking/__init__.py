"""What the control would refuse, or not run as programmed."""
