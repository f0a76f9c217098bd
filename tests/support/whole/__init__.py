"""Whole random schemas, and an independent reference for comparison with every output."""
