"""Surface fields on the lattice, their spectra, and measures of how alike two of them are."""
