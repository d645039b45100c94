"""What several studies share: worlds, faults, picks of an operator, tables and plots."""
