"""Pure mathematics on arrays: from a model to feedforward, and by practice to the arm's own repeatability."""
