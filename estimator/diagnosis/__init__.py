"""What a simulation gets wrong, and why: from recordings and the given model to named causes, with their evidence."""
