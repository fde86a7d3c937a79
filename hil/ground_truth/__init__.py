"""Models beside one another, and estimates beside the truth, which virtual plants alone have."""
