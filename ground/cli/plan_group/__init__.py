"""Commands of `outcrop plan` that work on plans as files."""
