"""What was observed: recordings as smoothed signals, what the given model leaves of them, and how noisy they are."""
