"""The first machine file of a shop: questions, effect of each answer, and a short file with the answers."""
