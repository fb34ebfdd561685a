"""What all commands share: options, words, and how they speak to a terminal."""
