"""The families of shapers, solved."""
