"""From the machine to the core: its controller, modes and drives, and programs simulated on them."""
