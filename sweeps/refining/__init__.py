"""Tables made better: where the next samples go, round by round, and by what score."""
