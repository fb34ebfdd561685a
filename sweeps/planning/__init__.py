"""Plans: the grammar of their files, their points, and what they ask for."""
