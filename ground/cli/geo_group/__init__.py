"""Commands about a site's place on its body."""
