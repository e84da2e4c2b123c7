"""The simulation twin: the model as a MuJoCo plant that replays what was recorded."""
