"""What a wrinkled surface is like in numbers, and whether it is inside itself."""
