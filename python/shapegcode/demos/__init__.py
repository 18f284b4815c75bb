"""The papers' figures, repeated: one file each."""
