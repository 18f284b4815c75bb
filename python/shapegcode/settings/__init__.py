"""Files of settings (TOML): their keys, how they are read, what is wrong in them, how they are described and edited."""
