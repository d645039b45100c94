"""`python -m ground.cli`: the command without its console script."""

from ground.cli.main import main

main()
