"""Many programs, machines and processes: a command over all of them, resumed where it stopped."""
