"""The Ground Data Repository and everything that people and programs talk to."""
