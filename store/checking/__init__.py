"""Tables looked at again: against their results, against each other, and at what truncation takes."""
