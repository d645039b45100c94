"""Files of targets and keep-outs."""
