"""What decides between the hypotheses that recordings leave: a motion, planned to tell them apart."""
