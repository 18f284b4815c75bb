"""The first machine file of a shop: questions, what each answer changes, and a short file of what was answered."""
