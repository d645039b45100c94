"""Forms of flight projects: dictionaries in, sequences and plans out.

F Prime's dictionary JSON and XTCE become `dictionary/1`; a straight run of a plan becomes F Prime's `.seq` or
PlanDev's seq-json, and each run of a plan a model-free plan for PlanDev.
"""
