"""Keep-outs."""
