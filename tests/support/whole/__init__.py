"""Whole random schemas, and an independent reference that every output is compared with."""
