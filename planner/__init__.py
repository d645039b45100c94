"""Pure algorithms: planning problem in, contingent plan out."""
