"""Evaluation, export, reports and learning curves of trained policies."""
