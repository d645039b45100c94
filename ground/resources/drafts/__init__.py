"""Drafts: what an assistant or a sentence proposes, and a person takes over or rejects."""
