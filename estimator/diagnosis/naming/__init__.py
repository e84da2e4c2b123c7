"""Which causes are named: searched for, sharpened, held against their rivals, and left out again."""
