"""What the paper says of its maps, and whether runs bear it out."""
