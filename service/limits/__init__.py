"""What a service refuses rather than suffer: too many, too long, too slow, too large."""
