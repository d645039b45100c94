"""The constraints of a planning problem, one class each: what models, bounds, engines and CRL find."""
