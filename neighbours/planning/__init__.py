"""Planning people's forms: a planning problem as PDDL and ANML, and plans of their engines back."""
