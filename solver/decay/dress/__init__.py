"""What a fruit wears: the pattern of its skin, its peel and lesions, stem and calyx."""
