"""The evidence: every hypothesis as columns of one linear model, and what recordings say about any set of them."""
