"""A result as one self-contained page: what stands on it (`model`, `scene`), and how it becomes HTML (`html`)."""
