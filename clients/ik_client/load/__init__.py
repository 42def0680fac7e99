"""`ik-load`: how fast and how reliably does a service answer under a given load?

Needs the extra `load` (HdrHistogram, rich); nothing else of `ik_client` imports it.
"""
