"""Check of programs: what the control would refuse, or not run as programmed."""
