"""What a diagnosis says, as plain data."""
