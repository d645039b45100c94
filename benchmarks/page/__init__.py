"""What `benchmarks.web` measures of the browser's page, a module for each kind of thing."""
