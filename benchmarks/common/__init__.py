"""What benchmarks share: the form of a figure, clocks, a service of their own, tables of draws."""
